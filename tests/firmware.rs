//! The firmware for the board builds, and fits: flash and RAM are printed and bounded.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "elf_rig/build.rs"]
mod elf_build;

use std::path::Path;

use elf_build::build;
use vergence_image::layout::{BOOTLOADER, CAPACITY, FLASH_BASE, IMAGE, RAM};

/// What the stack may need at least: interrupts upon a task that plans a move.
const STACK: u32 = 16 * 1024;

/// A section that takes memory on the board.
struct Section {
    address: u32,
    length: u32,
    /// Zeroed or left alone at start: takes no flash.
    is_empty: bool,
}

/// The allocated sections of a little-endian ELF32 (Tool Interface Standard, ELF 1.2).
fn sections(elf: &Path) -> Vec<Section> {
    const ALLOCATED: u32 = 2;
    const NOBITS: u32 = 8;
    let bytes = std::fs::read(elf).expect("the ELF is there");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let half = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let (table, size, count) = (word(0x20) as usize, half(0x2E), half(0x30));
    (0..count)
        .map(|index| table + index * size)
        .filter(|&at| word(at + 8) & ALLOCATED != 0)
        .map(|at| Section { address: word(at + 0xC), length: word(at + 0x14), is_empty: word(at + 4) == NOBITS })
        .collect()
}

/// Flash and RAM that a program takes, in bytes.
fn sizes(package: &str) -> (u32, u32) {
    let sections = sections(&build(package));
    let flash = sections.iter().filter(|section| !section.is_empty).map(|section| section.length).sum();
    let ram = sections.iter().filter(|section| section.address >= RAM.start).map(|section| section.length).sum();
    println!("{package}: {flash} bytes of flash, {ram} bytes of RAM without stack");
    (flash, ram)
}

#[test]
fn the_firmware_builds_and_fits() {
    let (flash, ram) = sizes("vergence-nucleo-g474");
    assert!(flash <= CAPACITY, "the application takes {flash} bytes of flash");
    assert!(ram <= RAM.length - STACK, "the application takes {ram} bytes of RAM");
    let (flash, ram) = sizes("vergence-bootloader");
    assert!(flash <= BOOTLOADER.length, "the boot loader takes {flash} bytes of flash");
    assert!(ram <= RAM.length - STACK, "the boot loader takes {ram} bytes of RAM");
}

#[test]
fn each_program_begins_with_its_vector_table() {
    for (package, region) in [("vergence-nucleo-g474", IMAGE), ("vergence-bootloader", BOOTLOADER)] {
        let first = sections(&build(package)).iter().map(|section| section.address).min();
        assert_eq!(first, Some(FLASH_BASE + region.start), "{package}");
    }
}
