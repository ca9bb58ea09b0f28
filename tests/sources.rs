//! The source of the workspace: what pure crates, libraries and verbs may name, and how long crates and files may be.
//!
//! The dependencies between crates are checked in `structure.rs`.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Folders of crates without files, sockets, clocks, threads and prints. All their source is searched.
const PURE: &[&str] = &[
    "protocol",
    "firmware/control",
    "firmware/dynamixel",
    "host/vision",
    "host/alignment",
    "host/rig",
    "host/exchange",
    "host/targets",
    "host/calibration",
    "host/matching",
    "host/pipeline",
    "host/plausibility",
    "host/page",
    "hil-sim/cpu",
    "hil-sim/lens",
    "hil-sim/mcu",
    "hil-sim/plant",
    "hil-sim/rig",
    "hil-sim/scene",
    "hil-sim/soak",
];

/// What a pure crate must not name.
const IMPURE: &[&str] = &[
    "std::fs",
    "std::net",
    "std::thread",
    "time::Instant",
    "Instant::now",
    "SystemTime",
    "print!",
    "println!",
    "eprint!",
    "eprintln!",
];

/// What the pipeline must not name besides: sessions, the command line, progress bars and clocks.
const OUTSIDE_THE_PIPELINE: &[&str] = &["vergence_protocol::session", "clap", "indicatif", "Instant"];

/// Largest numbers of lines of a crate's source and of a file.
const LARGEST_CRATE: usize = 9400;
const LARGEST_FILE: usize = 400;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The `.rs` files under `folder`, without build outputs, each with its text.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() && name != "target" && name != ".git" {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&path).expect("readable source");
            found.push((path, text));
        }
    }
    found
}

/// Whether `text` names `what` outside of comments, not as a part of a longer name.
fn names(text: &str, what: &str) -> bool {
    let part_of_name = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    let in_line = |line: &str| {
        line.match_indices(what).any(|(at, _)| {
            let (before, after) = (line[..at].chars().next_back(), line[at + what.len()..].chars().next());
            !part_of_name(before) && !part_of_name(after)
        })
    };
    text.lines().filter(|line| !line.trim_start().starts_with("//")).any(in_line)
}

/// Fails with each source file under `folder` that names one of `forbidden`.
fn refuse(folder: &str, forbidden: &[&str]) {
    let sources = sources(&root().join(folder).join("src"));
    assert!(!sources.is_empty(), "{folder} has no source");
    for (path, text) in sources {
        let found: Vec<_> = forbidden.iter().filter(|what| names(&text, what)).collect();
        assert!(found.is_empty(), "{} names {found:?}", path.display());
    }
}

#[test]
fn pure_crates_touch_nothing_outside() {
    for folder in PURE {
        refuse(folder, IMPURE);
    }
    refuse("host/pipeline", OUTSIDE_THE_PIPELINE);
    assert!(names("let now = Instant::now();", "Instant::now") && !names("// std::fs", "std::fs"));
    assert!(!names("BoardInstant { us }", "Instant"));
}

/// The folders with a `Cargo.toml` and a `src`, relative to the root.
fn crates(folder: &Path) -> Vec<PathBuf> {
    let folders = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let inner = folders.filter(|path| path.is_dir() && !path.ends_with("target") && !path.ends_with(".git"));
    let mut found: Vec<_> = inner.flat_map(|path| crates(&path)).collect();
    if folder.join("Cargo.toml").is_file() && folder.join("src").is_dir() {
        found.push(folder.to_owned());
    }
    found
}

#[test]
fn only_the_command_knows_how_it_fails() {
    let crates = crates(&root());
    assert!(crates.len() > 20, "crates are missing: {crates:?}");
    let of_the_command = ["host/vergence", "host/failure"];
    for folder in crates.iter().filter(|folder| !of_the_command.iter().any(|its| folder.ends_with(its))) {
        for (path, text) in sources(&folder.join("src")) {
            assert!(!names(&text, "Failure"), "{} names Failure: a library has errors of its own", path.display());
        }
    }
}

#[test]
fn crates_and_files_stay_small() {
    let too_long = |path: &Path, lines: usize, most: usize| {
        (lines > most).then(|| format!("{}: {lines} lines, at most {most}", path.display()))
    };
    let lines = |text: &str| text.matches('\n').count();
    let crates = crates(&root()).into_iter().filter_map(|folder| {
        let all = sources(&folder.join("src")).iter().map(|(_, text)| lines(text)).sum();
        too_long(&folder, all, LARGEST_CRATE)
    });
    let files = sources(&root()).into_iter().filter_map(|(path, text)| too_long(&path, lines(&text), LARGEST_FILE));
    let found: Vec<_> = crates.chain(files).collect();
    assert!(found.is_empty(), "{found:#?}");
}

/// A library is compiled once more for the tests in its own files: without any that is time for nothing, and with some they must run.
#[test]
fn libraries_are_built_for_tests_where_they_have_some() {
    // The board's programs have a workspace of their own, the fuzzers no tests.
    let elsewhere = [
        "firmware/nucleo-g474",
        "firmware/nucleo-common",
        "firmware/bootloader",
        "hil-sim/cpu/differential",
        "tests/fuzz",
    ];
    let crates = crates(&root()).into_iter().filter(|folder| !elsewhere.iter().any(|other| folder.ends_with(other)));
    for folder in crates.filter(|folder| folder.join("src/lib.rs").is_file()) {
        let text = std::fs::read_to_string(folder.join("Cargo.toml")).expect("a manifest");
        let manifest: toml::Table = text.parse().expect("TOML");
        let is_built =
            manifest.get("lib").and_then(|lib| lib.get("test")).and_then(toml::Value::as_bool) != Some(false);
        let has_tests = sources(&folder.join("src")).iter().any(|(_, text)| text.contains("#[cfg(test)]"));
        assert_eq!(is_built, has_tests, "{}: whether its library is built for tests", folder.display());
    }
}

/// A verb is a module of `cmd` with a function `run` of its own.
#[test]
fn verbs_use_no_other_verbs_files() {
    let folder = root().join("host/vergence/src/cmd");
    let sources = sources(&folder);
    let module = |path: &Path| {
        let first = path.strip_prefix(&folder).expect("inside").components().next().expect("a name");
        Path::new(first.as_os_str()).with_extension("").display().to_string()
    };
    let runs =
        |text: &str| text.lines().any(|line| line.starts_with("pub fn run(") || line.starts_with("pub async fn run("));
    let is_root = |path: &Path| path.parent() == Some(folder.as_path()) || path.ends_with("mod.rs");
    let verbs: BTreeSet<_> = sources
        .iter()
        .filter(|(path, text)| is_root(path) && runs(text))
        .map(|(path, _)| module(path))
        .filter(|name| name != "mod")
        .collect();
    assert!(verbs.len() > 20, "{verbs:?}");
    let mut found = Vec::new();
    for (path, text) in sources.iter().filter(|(path, _)| verbs.contains(&module(path))) {
        let own = module(path);
        let parent = if is_root(path) { "super::" } else { "super::super::" };
        assert!(!text.contains("crate::cmd::{"), "{}: one `use crate::cmd::...` for each module", path.display());
        let uses =
            |verb: &&String| names(text, &format!("crate::cmd::{verb}")) || names(text, &format!("{parent}{verb}"));
        let others = verbs.iter().filter(|verb| **verb != own).filter(uses);
        found.extend(others.map(|other| format!("{} uses {other}", path.display())));
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn every_test_finds_real_data_by_one_function() {
    let all = ["host", "hil-sim", "protocol", "firmware", "tests"].map(|folder| sources(&root().join(folder))).concat();
    let is_test = |path: &Path| path.components().any(|part| part.as_os_str() == "tests");
    let asks = |text: &str| text.contains(concat!("var", "_os(\"VERGENCE_SHARED"));
    let asking: Vec<_> = all.iter().filter(|(path, text)| is_test(path) && asks(text)).map(|(path, _)| path).collect();
    assert!(asking.len() == 1 && asking[0].ends_with("tests/common/data.rs"), "{asking:?}");
}
