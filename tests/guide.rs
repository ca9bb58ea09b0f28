//! The guide's commands, word by word: those marked `sh` run against a simulated board. Every command of every page parses.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::{Simulator, small_bench_toml, text};

/// The port that the guide names; the test puts the simulated board's in its place.
const GUIDES_PORT: &str = "/dev/ttyACM0";

/// Verbs that arm the board. Their lease is longer here than the guide's: the machine that runs tests may be busy.
const ARMING: &str = "home|mode|move";

fn guide() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide.md");
    fs::read_to_string(path).expect("the guide")
}

/// The commands of the blocks with this fence, one a line, in order.
fn commands(page: &str, fence: &str) -> Vec<String> {
    let mut inside = None;
    let mut commands = Vec::new();
    for line in page.lines() {
        match (inside, line.strip_prefix("```")) {
            (None, Some(opened)) => inside = Some(opened),
            (Some(_), Some("")) => inside = None,
            (Some(opened), None) if opened == fence => commands.push(line.to_owned()),
            _ => {}
        }
    }
    commands
}

/// A `vergence` for the shell, which adds the long lease.
fn install(folder: &Path) {
    let wrapper = folder.join("vergence");
    let binary = env!("CARGO_BIN_EXE_vergence");
    let script = format!(
        "#!/bin/sh\ncase \"$1\" in ({ARMING}) exec {binary} --lease 1s \"$@\" ;; (*) exec {binary} \"$@\" ;; esac\n"
    );
    fs::write(&wrapper, script).expect("a script is written");
    fs::set_permissions(&wrapper, fs::Permissions::from_mode(0o755)).expect("it may be run");
}

#[test]
fn the_guide_runs_on_a_simulated_board() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (bin, work) = (folder.path().join("bin"), folder.path().join("work"));
    fs::create_dir_all(work.join("host/rig/src")).expect("a folder");
    fs::create_dir_all(&bin).expect("a folder");
    fs::write(work.join("host/rig/src/bench.toml"), small_bench_toml()).expect("the drawing is written");
    install(&bin);
    let board = Simulator::start(&[]);
    let commands = commands(&guide(), "sh");
    assert!(commands.len() > 20, "only {} commands were found", commands.len());
    let script = commands.join("\n").replace(GUIDES_PORT, &board.port);
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap_or_default());
    let output = Command::new("sh")
        .args(["-e", "-x", "-c", &script])
        .current_dir(&work)
        .env("PATH", path)
        .env("VERGENCE_STORE", folder.path().join("store"))
        .env_remove("VERGENCE_PORT")
        .env_remove("VERGENCE_RIG")
        .stdin(Stdio::null())
        .output()
        .expect("a shell");
    println!("{}\n{}", text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "the last command above failed");
    for file in
        ["rig.key", "rig.key.pub", "factory.toml", "zones.svg", "target.svg", "clouds/cloud.ply", "clouds/cloud.csv"]
    {
        assert!(work.join(file).exists(), "the guide did not leave {file}");
    }
    let table = fs::read_to_string(work.join("clouds/cloud.csv")).expect("a table");
    let columns = table.lines().next().unwrap_or_default();
    for column in ["sigma_range_mm", "cov_xx_mm2"] {
        assert!(columns.contains(column) && guide().contains(column), "{column} in {columns}");
    }
    assert!(table.lines().count() > 20, "only {} points", table.lines().count() - 1);
}

/// The words of a command line as a shell divides it, without its comment.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for c in line.chars() {
        match (quote, c) {
            (None, '\'' | '"') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            (None, '#') if word.is_empty() => break,
            (None, ' ') if word.is_empty() => {}
            (None, ' ') => words.push(std::mem::take(&mut word)),
            _ => word.push(c),
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

/// The Markdown pages in a folder.
fn pages_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries.filter(|path| path.extension().is_some_and(|ending| ending == "md")).collect()
}

#[test]
fn every_command_in_a_page_parses() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut parsed = 0;
    for page in [pages_in(&root), pages_in(&root.join("docs"))].concat() {
        let text = fs::read_to_string(&page).expect("a page");
        let lines = ["sh", "sh hardware"].map(|fence| commands(&text, fence)).concat();
        for line in lines.iter().filter(|line| line.starts_with("vergence ")) {
            if let Err(error) = vergence::cli::command().try_get_matches_from(words(line)) {
                // Help is an answer too.
                assert!(!error.use_stderr(), "{}: {line}\n{error}", page.display());
            }
            parsed += 1;
        }
    }
    assert!(parsed > 40, "only {parsed} commands were found");
}

#[test]
fn the_drawing_has_the_pins_of_the_board() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |path: &str| fs::read_to_string(root.join(path)).expect("a file of the repository");
    let board =
        ["board.rs", "wiring/two_axes.rs"].map(|file| read(&format!("firmware/nucleo-g474/src/{file}"))).concat();
    let (page, drawing) = (read("docs/firmware.md"), read("docs/wiring.svg"));
    // The serial line and the light are on the board itself; the servo bus is only reserved.
    let not_wired = ["PA2", "PA3", "PA5", "PB10", "PB14"];
    let pins = board.split("p.P").skip(1).map(|rest| {
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
        format!("P{}", &rest[..end])
    });
    let mut drawn = 0;
    for pin in pins.filter(|pin| !not_wired.contains(&pin.as_str())) {
        assert!(page.contains(&pin), "{pin} is not in docs/firmware.md");
        assert!(drawing.contains(&format!(">{pin}<")), "{pin} is not in docs/wiring.svg");
        drawn += 1;
    }
    assert!(drawn >= 15, "only {drawn} pins were found in board.rs and two_axes.rs");
}
