//! `vergence sim --elf`: the firmware answers the other verbs like any board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "elf_rig/build.rs"]
mod build;
mod common;

use common::{Simulator, fails_with};

#[test]
fn the_firmware_answers_at_a_pseudo_terminal() {
    let elf = build::build("vergence-nucleo-g474");
    let simulator = Simulator::start(&["--elf", elf.to_str().expect("a plain path")]);
    let status = simulator.json(&["status"]);
    println!("{status}");
    assert_eq!(status["board"], "nucleo-g474");
    assert_eq!(status["state"], "idle");
}

#[test]
fn a_program_for_another_machine_is_refused() {
    let own = std::env::current_exe().expect("this test is a program");
    fails_with(&["sim", "--elf", own.to_str().expect("a plain path")], 2, &["32-bit ELF"]);
}
