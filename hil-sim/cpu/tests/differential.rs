//! Compares the output of the differential program with that of QEMU's `mps2-an386`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test helper that fails is a test that fails")]

mod common;

use std::path::PathBuf;
use std::process::Command;

use common::Board;
use vergence_cpu::{Cpu, Stop};

/// Made by `differential/golden.sh`.
const EXPECTED: &str = include_str!("differential.txt");
const WRITE0: u32 = 4;
const EXIT: u32 = 0x18;
/// Limit in cycles, far more than the program needs: it ends a run that hangs.
const LIMIT: u64 = 4_000_000_000;

/// Builds the program for the target, in a folder of its own.
fn build() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("differential");
    let target = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("differential");
    let output = Command::new(env!("CARGO"))
        .args(["build", "--release", "--offline", "--target", "thumbv7em-none-eabihf", "--manifest-path"])
        .arg(folder.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .output()
        .expect("cargo runs");
    assert!(
        output.status.success(),
        "building the differential program failed; is the target installed (rustup target add thumbv7em-none-eabihf)?\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    target.join("thumbv7em-none-eabihf/release/differential")
}

/// Copies the loadable segments of a 32-bit little-endian ELF to where they run.
fn load(elf: &[u8], board: &mut Board) {
    const LOAD: u32 = 1;
    let word = |at: usize| u32::from_le_bytes(elf[at..at + 4].try_into().expect("four bytes"));
    let half = |at: usize| usize::from(u16::from_le_bytes(elf[at..at + 2].try_into().expect("two bytes")));
    let (headers, size, count) = (word(28) as usize, half(42), half(44));
    for header in (0..count).map(|index| headers + index * size) {
        let (kind, offset, address, length) =
            (word(header), word(header + 4) as usize, word(header + 8), word(header + 16) as usize);
        if kind == LOAD {
            board.put(address, &elf[offset..offset + length]);
        }
    }
}

/// Runs the program and returns its output.
fn run() -> String {
    let elf = std::fs::read(build()).expect("the program was built");
    let mut board = Board::default();
    load(&elf, &mut board);
    let mut cpu = Cpu::new();
    cpu.reset(&mut board);
    let mut printed = String::new();
    loop {
        let stop = cpu.run(&mut board, LIMIT);
        assert_eq!(stop, Stop::Semihosting, "at {:#010x} after {} cycles:\n{printed}", cpu.pc(), cpu.now());
        match cpu.register(0) {
            WRITE0 => printed.push_str(&board.text(cpu.register(1))),
            EXIT => return printed,
            other => panic!("semihosting call {other:#x}"),
        }
    }
}

#[test]
fn every_instruction_form_and_exception_agrees_with_qemu() {
    let printed = run();
    let mut differences = Vec::new();
    let (mut ours, mut theirs) = (printed.lines(), EXPECTED.lines());
    loop {
        match (ours.next(), theirs.next()) {
            (None, None) => break,
            (ours, theirs) if ours == theirs => {}
            (ours, theirs) => differences.push(format!("core {}\nqemu {}", ours.unwrap_or("-"), theirs.unwrap_or("-"))),
        }
    }
    assert!(differences.is_empty(), "{} lines differ:\n{}", differences.len(), differences.join("\n"));
}
