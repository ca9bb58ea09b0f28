//! Running the binary and reading what it says.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

pub mod browser;
pub mod built_bench;
pub mod cameras;
pub mod corner_files;
pub mod data;
pub mod dense_files;
pub mod images;
pub mod pairs;
pub mod python;
pub mod rendered;
pub mod served;
pub mod servo_line;

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

pub use data::real_data;
pub use python::python;
use serde_json::Value;
use vergence_rig::BENCH_TOML;

/// The binary with `arguments`, and none of the caller's own settings.
pub fn vergence(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vergence"));
    command
        .args(arguments)
        .env_remove("VERGENCE_PORT")
        .env_remove("VERGENCE_RIG")
        .env_remove("VERGENCE_MODELS")
        .stdin(Stdio::null());
    command.env("VERGENCE_STORE", "/nowhere/calibrations");
    command
}

/// Runs it to its end.
pub fn run(arguments: &[&str]) -> Output {
    vergence(arguments).output().expect("the binary runs")
}

/// Runs it and reads its JSON.
pub fn run_json(arguments: &[&str]) -> Value {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?} failed: {} {}", text(&output.stderr), text(&output.stdout));
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

/// Runs it, expects exit code `code` and an error sentence that contains every one of `words`.
pub fn fails_with(arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(arguments);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?} said: {said}");
    for word in words {
        assert!(said.contains(word), "{arguments:?} should mention '{word}', said: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
}

/// Sends a signal such as `-INT`, which is Ctrl-C.
pub fn signal(process: u32, name: &str) {
    let sent = Command::new("kill").args([name, &process.to_string()]).status().expect("kill runs");
    assert!(sent.success());
}

/// The rig file of the bench with images of 320 x 320 pixels.
pub fn small_bench_toml() -> String {
    BENCH_TOML.replace("[1280, 1280]", "[320, 320]").replace("366.0", "91.5").replace("639.5", "159.5")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Whether the verb that `arguments` name has an option for its lease.
fn takes_a_lease(arguments: &[&str]) -> bool {
    let mut whole = vergence::cli::command();
    whole.build();
    let mut verb = &whole;
    for word in arguments {
        match verb.find_subcommand(word) {
            Some(inner) => verb = inner,
            None if verb.has_subcommands() => {}
            None => break,
        }
    }
    verb.get_arguments().any(|option| option.get_long() == Some("lease"))
}

/// A `vergence sim` in its own process; ends with the value.
pub struct Simulator {
    process: Child,
    pub port: String,
}

impl Simulator {
    pub fn start(arguments: &[&str]) -> Self {
        let mut process =
            vergence(&["sim", "--json"]).args(arguments).stdout(Stdio::piped()).spawn().expect("the simulator starts");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("piped")).read_line(&mut line).expect("it says its port");
        let said: Value = serde_json::from_str(&line).expect("JSON");
        let port = said["port"].as_str().expect("a port").to_owned();
        Self { process, port }
    }

    /// The verb over this simulator's port. Where it holds a lease, that is long: the machine that runs the tests may be busy.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = vergence(&["--port", &self.port]);
        if takes_a_lease(arguments) {
            command.args(["--lease", "1s"]);
        }
        command.args(arguments);
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the binary runs")
    }

    pub fn json(&self, arguments: &[&str]) -> Value {
        let output = self.command(arguments).arg("--json").output().expect("the binary runs");
        assert!(output.status.success(), "{arguments:?} failed: {} {}", text(&output.stderr), text(&output.stdout));
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    /// Asks it to end, and expects that it does so in order.
    pub fn terminate(&mut self) {
        let asked = Command::new("kill").arg(self.process.id().to_string()).status().expect("kill runs");
        assert!(asked.success() && self.process.wait().expect("it was started").success());
    }

    pub fn kill(&mut self) {
        // A process that has ended already is what we want.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        self.kill();
    }
}
