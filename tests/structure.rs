//! The house: who may depend on whom, which licences may come in, and that the core needs no operating system.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "structure/arrows.rs"]
mod arrows;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use arrows::{ALLOWED, EVERYTHING, ONLY_FOR};
use serde_json::Value;

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
    "IJG",
    "BSL-1.0",
    "Unicode-3.0",
    "Unlicense",
    "CC0-1.0",
];

const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("serialport", "MPL-2.0", "copyleft by file, used unchanged; the serial port library of the Rust world"),
    ("mio-serial", "MPL-2.0", "the same"),
    ("option-ext", "MPL-2.0", "the same; only with the feature zenoh"),
];

/// The workspaces: what runs on a computer, and what runs on the board, the boot loader included.
const HOST: &str = "Cargo.toml";
const BOARD: &str = "firmware/nucleo-g474/Cargo.toml";

fn metadata(workspace: &str) -> Value {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(workspace);
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--all-features", "--manifest-path"])
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
            assert!(
                !used.starts_with("vergence") || may.contains(&used) || *may == EVERYTHING,
                "{name} must not use {used}"
            );
            let users = ONLY_FOR.iter().find(|(library, _)| *library == used).map(|(_, users)| *users);
            assert!(users.is_none_or(|users| users.contains(&name)), "{name} must not use {used}");
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
        .args(["build", "--release", "--locked"])
        .args(["-p", "vergence-protocol", "-p", "vergence-control", "-p", "vergence-dynamixel"])
        .args(["--target", "thumbv7em-none-eabihf", "--target-dir"])
        .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("thumb"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The files of the board's application, and which others of them each imports.
fn imports_of_board_files() -> BTreeMap<String, BTreeSet<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/nucleo-g474/src");
    let files: BTreeMap<String, String> = std::fs::read_dir(folder)
        .expect("the folder is there")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_file())
        .map(|path| (path.file_stem().expect("a name").to_string_lossy().into_owned(), path))
        .map(|(name, path)| (name, std::fs::read_to_string(path).expect("a text")))
        .collect();
    let imports = |text: &str| {
        let paths = text.split("crate::").skip(1).flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').collect(),
            None => vec![rest],
        });
        let names = paths.map(|path| path.trim().split(|letter: char| !letter.is_alphanumeric() && letter != '_'));
        names.filter_map(|mut name| name.next().filter(|name| files.contains_key(*name)).map(str::to_owned)).collect()
    };
    files.iter().map(|(name, text)| (name.clone(), imports(text))).collect()
}

#[test]
fn the_boards_files_do_not_import_each_other_in_a_ring() {
    let mut left = imports_of_board_files();
    assert!(left["control"].contains("exchange") && left["dying"].contains("board"), "imports are found: {left:?}");
    // Take away what imports nothing that is left, until nothing can be taken away: the rest is in or above a ring.
    loop {
        let names: BTreeSet<String> = left.keys().cloned().collect();
        left.retain(|_, imports| imports.iter().any(|import| names.contains(import)));
        if left.len() == names.len() {
            break;
        }
    }
    assert!(left.is_empty(), "in or above a ring: {left:?}");
}
