//! A board that takes firmware of the development key is warned of; one with a key of its own is not.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod common;

use common::images::Workshop;
use common::{Simulator, text};

#[test]
fn status_and_doctor_warn_of_the_development_key() {
    let simulator = Simulator::start(&["--pty"]);
    assert_eq!(simulator.json(&["status"])["key"], "development");
    let warned = text(&simulator.run(&["status"]).stderr);
    assert!(warned.contains("development key"), "{warned}");
    let told = text(&simulator.run(&["doctor"]).stdout);
    assert!(told.contains("warn  key") && told.contains("docs/flashing.md"), "{told}");
}

#[test]
fn a_key_of_its_own_is_named() {
    let workshop = Workshop::new();
    let [_, public] = workshop.key("rig.key");
    let digits = std::fs::read_to_string(&public).expect("keygen wrote it");
    let digits = digits.trim().rsplit(' ').next().expect("the key").to_owned();
    let simulator = Simulator::start(&["--pty", "--trust", &public]);
    assert_eq!(simulator.json(&["status"])["key"], digits.as_str());
    let warned = text(&simulator.run(&["status"]).stderr);
    assert!(!warned.contains("development key"), "{warned}");
    let told = text(&simulator.run(&["doctor"]).stdout);
    assert!(told.contains("pass  key") && told.contains(&digits[..16]), "{told}");
}
