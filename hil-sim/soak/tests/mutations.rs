//! Defects planted in the controller's own source: each is compiled into a copy of the sources and played by the tests of
//! `soak.rs`, which must fail.
//!
//! Compiling all of them takes long, so that this runs by hand: `VERGENCE_MUTATIONS=all`, or parts of names with commas between
//! them. Otherwise the list is only compared with the sources.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "mutations/list.rs"]
mod list;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use list::{CAUGHT, HOLES, Mutation};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The source with the mutation.
fn mutated(mutation: &Mutation) -> String {
    let path = workspace().join("firmware/control/src").join(mutation.file);
    let source = fs::read_to_string(&path).expect("a source of the controller");
    let found = source.matches(mutation.from).count();
    assert_eq!(found, 1, "'{}' for '{}' stands {found} times in {}", mutation.from, mutation.what, mutation.file);
    source.replace(mutation.from, mutation.to)
}

#[test]
fn the_list_fits_the_sources() {
    assert!(CAUGHT.len() >= 40);
    for mutation in CAUGHT.iter().chain(HOLES) {
        assert_ne!(mutated(mutation), "");
    }
}

#[test]
fn every_mutation_is_caught_or_named_as_a_hole() {
    let Ok(wanted) = env::var("VERGENCE_MUTATIONS") else {
        return println!("SKIPPED mutations: VERGENCE_MUTATIONS=all compiles and plays each, which takes an hour");
    };
    let copy = Copy::of_the_workspace();
    let chosen = |mutation: &&Mutation| wanted == "all" || wanted.split(',').any(|part| mutation.what.contains(part));
    let mut wrong = Vec::new();
    for (is_caught, list) in [(true, CAUGHT), (false, HOLES)] {
        for mutation in list.iter().filter(chosen) {
            let caught = copy.catches(mutation);
            println!("{:<60} {}", mutation.what, caught.as_deref().unwrap_or("not caught"));
            if caught.is_some() != is_caught {
                wrong.push(mutation.what);
            }
        }
    }
    assert!(wrong.is_empty(), "not as listed: {wrong:#?}");
}

/// A copy of the sources, compiled apart.
struct Copy(PathBuf);

impl Copy {
    fn of_the_workspace() -> Self {
        let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mutations");
        let files = Command::new("git").args(["ls-files", "-z"]).current_dir(workspace()).output().expect("git");
        for name in String::from_utf8_lossy(&files.stdout).split_terminator('\0') {
            let (from, to) = (workspace().join(name), copy.join(name));
            fs::create_dir_all(to.parent().expect("a folder")).expect("a folder in the copy");
            write_changed(&to, &fs::read(&from).expect("a tracked file"));
        }
        Self(copy)
    }

    /// Plays the scenarios with a mutation; returns what found it.
    fn catches(&self, mutation: &Mutation) -> Option<String> {
        let path = self.0.join("firmware/control/src").join(mutation.file);
        let original = fs::read(&path).expect("a copied source");
        fs::write(&path, mutated(mutation)).expect("a file in the copy");
        let built = self.test(&["--no-run"]);
        assert!(built.status.success(), "'{}': {}", mutation.what, String::from_utf8_lossy(&built.stderr));
        let played = self.test(&["--", "no_promise", "do_not_defeat", "spikes"]);
        fs::write(&path, original).expect("a file in the copy");
        let said = String::from_utf8_lossy(&played.stdout).into_owned();
        (!played.status.success()).then(|| reason(&said))
    }

    fn test(&self, options: &[&str]) -> std::process::Output {
        let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        Command::new(cargo)
            .args(["test", "--offline", "-p", "vergence-soak", "--no-default-features", "--test", "soak"])
            .args(options)
            .env("CARGO_TARGET_DIR", self.0.join("target"))
            .env("RUSTFLAGS", "-Awarnings")
            .current_dir(&self.0)
            .output()
            .expect("cargo")
    }
}

/// Writes a file if its content differs, so that nothing is compiled without need.
fn write_changed(path: &Path, bytes: &[u8]) {
    if fs::read(path).ok().as_deref() != Some(bytes) {
        fs::write(path, bytes).expect("a file in the copy");
    }
}

/// The promise that was broken first, or the test that failed.
fn reason(said: &str) -> String {
    let promise = said.split("promise: ").nth(1).and_then(|rest| rest.split(',').next());
    let failed = said.lines().find_map(|line| line.strip_suffix(" ... FAILED"));
    let named = promise.map(|promise| format!("promise {promise}"));
    named.or_else(|| failed.map(str::to_owned)).unwrap_or_else(|| "the tests failed".to_owned())
}
