//! The house: who may depend on whom, which licences may come in, and that the core needs no operating system.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// An arrow points to what is used. Tests may use more (dev-dependencies are not looked at).
const ALLOWED: &[(&str, &[&str])] = &[
    ("vergence-protocol", &[]),
    ("vergence-control", &["vergence-protocol"]),
    ("vergence-image", &["vergence-protocol"]),
    ("vergence-vision", &[]),
    ("vergence-rig", &["vergence-protocol", "vergence-vision"]),
    ("vergence-page", &[]),
    ("vergence-calibration", &["vergence-vision", "vergence-rig", "vergence-page"]),
    ("vergence-matching", &["vergence-vision"]),
    ("vergence-networks", &["vergence-matching"]),
    ("vergence-scene", &["vergence-vision"]),
    ("vergence-cpu", &[]),
    ("vergence-mcu", &["vergence-cpu", "vergence-protocol", "vergence-control", "vergence-plant"]),
    ("vergence-plant", &["vergence-protocol", "vergence-control"]),
    ("vergence-soak", &["vergence-protocol", "vergence-control", "vergence-image", "vergence-mcu", "vergence-plant"]),
    (
        "vergence",
        &[
            "vergence-protocol",
            "vergence-control",
            "vergence-image",
            "vergence-vision",
            "vergence-rig",
            "vergence-calibration",
            "vergence-matching",
            "vergence-networks",
            "vergence-page",
            "vergence-scene",
            "vergence-mcu",
            "vergence-plant",
            "vergence-soak",
        ],
    ),
];

/// Only host/vergence touches devices, files, sockets, clocks, threads and the terminal.
const ONLY_FOR_THE_BINARY: &[&str] =
    &["tokio", "tokio-serial", "serialport", "clap", "indicatif", "tempfile", "moq-v4l"];

/// Permissive licences.
const LICENCES: &[&str] = &[
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "0BSD",
    "ISC",
    "Zlib",
    "BSL-1.0",
    "Unicode-3.0",
    "Unlicense",
    "CC0-1.0",
];

/// Exceptions, each with its reason.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("serialport", "MPL-2.0", "copyleft by file, used unchanged; the serial port library of the Rust world"),
    ("mio-serial", "MPL-2.0", "the same"),
];

/// The workspaces: what runs on a computer, and what runs on the board, the boot loader included.
const HOST: &str = "Cargo.toml";
const BOARD: &str = "firmware/nucleo-g474/Cargo.toml";

fn metadata(workspace: &str) -> Value {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(workspace);
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--manifest-path"])
        .arg(manifest)
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_default()
}

#[test]
fn dependencies_point_the_right_way() {
    let metadata = metadata(HOST);
    let members: BTreeSet<&str> = list(&metadata["workspace_members"]).iter().filter_map(Value::as_str).collect();
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let mut seen = 0;
    for package in list(&metadata["packages"]) {
        if !members.contains(package["id"].as_str().unwrap_or_default()) {
            continue;
        }
        let name = package["name"].as_str().expect("a name");
        let may = allowed.get(name).unwrap_or_else(|| panic!("{name} has no place in the house: add it to ALLOWED"));
        seen += 1;
        for dependency in list(&package["dependencies"]).iter().filter(|d| d["kind"] != "dev") {
            let used = dependency["name"].as_str().expect("a name");
            assert!(!used.starts_with("vergence") || may.contains(&used), "{name} must not use {used}");
            assert!(name == "vergence" || !ONLY_FOR_THE_BINARY.contains(&used), "{name} must not use {used}");
        }
    }
    assert_eq!(seen, ALLOWED.len(), "a crate of the house is missing from the workspace");
}

#[test]
fn licences_are_permissive() {
    let mut strangers = Vec::new();
    let [host, board] = [HOST, BOARD].map(metadata);
    let known =
        |metadata: &Value, name: &str| list(&metadata["packages"]).iter().any(|package| package["name"] == name);
    assert!(known(&host, "tokio") && known(&board, "embassy-stm32") && known(&board, "vergence-bootloader"));
    for package in list(&host["packages"]).iter().chain(list(&board["packages"])) {
        let name = package["name"].as_str().expect("a name");
        let licence = package["license"].as_str().unwrap_or_default();
        if EXCEPTIONS.iter().any(|(exempt, what, _)| *exempt == name && *what == licence) {
            continue;
        }
        let permitted = spdx::Expression::parse_mode(licence, spdx::ParseMode::LAX)
            .is_ok_and(|expression| expression.evaluate(|needed| LICENCES.contains(&needed.to_string().as_str())));
        if !permitted {
            strangers.push(format!("{name}: '{licence}'"));
        }
    }
    assert!(strangers.is_empty(), "licences outside the list: {strangers:?}");
}

#[test]
fn protocol_and_control_need_no_operating_system() {
    let output = Command::new(env!("CARGO"))
        .args(["build", "--locked", "-p", "vergence-protocol", "-p", "vergence-control"])
        .args(["--target", "thumbv7em-none-eabihf", "--target-dir"])
        .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("thumb"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
