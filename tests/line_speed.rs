//! `vergence config set baud` on the firmware, behind a serial adapter that makes the speed and one that does not.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]
#![allow(clippy::disallowed_methods, reason = "the simulated board runs in real time")]

#[path = "elf_rig/build.rs"]
mod build;
mod common;

use common::{Simulator, text};

fn simulator(more: &[&str]) -> Simulator {
    let elf = build::build("vergence-nucleo-g474").display().to_string();
    Simulator::start(&[&["--elf", &elf][..], more].concat())
}

#[test]
fn a_speed_that_the_adapter_cannot_make_is_taken_back_and_said() {
    let simulator = simulator(&["--adapter", "1000000"]);
    let output = simulator.run(&["config", "set", "baud", "2000000"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("back at 921600 baud") && said.contains("nothing was saved"), "{said}");
    assert_eq!(simulator.json(&["config", "get", "baud"])["baud"], 921_600);
    let refused = simulator.run(&["config", "set", "baud", "300"]);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
}

#[test]
fn a_speed_that_works_is_saved_and_used_from_then_on() {
    let simulator = simulator(&[]);
    let said = simulator.json(&["config", "set", "baud", "2000000"]);
    assert_eq!((&said["value"], &said["saved"]), (&"2000000".into(), &true.into()));
    // A host that was not told finds the board too, because nobody else speaks to it.
    for arguments in [&["--baud", "2000000", "status"][..], &["--baud", "2000000", "config", "get", "baud"]] {
        simulator.json(arguments);
    }
    std::thread::sleep(std::time::Duration::from_secs(6));
    assert_eq!(simulator.json(&["config", "get", "baud"])["baud"], 2_000_000);
}
