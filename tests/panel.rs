//! The panel as people use it: `vergence panel` of a simulated rig in a real browser, which clicks, watches and looks.
//!
//! It needs node, and Chromium (`VERGENCE_CHROMIUM`, or `chromium` in the path), and what `npm ci` fetches in `tests/panel`. Without them the
//! test prints `SKIPPED`; with `VERGENCE_REQUIRE_DATA=1` it fails. Its pictures are kept in `target/tmp/panel`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Command, Stdio};

use common::browser::{browser, pictures};
use common::{fails_with, signal, small_bench_toml, vergence};
use serde_json::Value;

/// A panel in its own process; ends with the value.
struct Served {
    process: Child,
    /// Where it goes on to write.
    _out: BufReader<ChildStdout>,
    url: String,
}

impl Served {
    fn start(arguments: &[&str]) -> Self {
        let mut process = vergence(arguments).arg("--json").stdout(Stdio::piped()).spawn().expect("the panel starts");
        let mut out = BufReader::new(process.stdout.take().expect("piped"));
        let mut line = String::new();
        out.read_line(&mut line).expect("it says where it is");
        let said: Value = serde_json::from_str(&line).expect("JSON");
        Self { process, _out: out, url: said["url"].as_str().expect("an address").to_owned() }
    }

    /// Ends as by Ctrl-C, in order.
    fn terminate(&mut self) {
        signal(self.process.id(), "-TERM");
        assert!(self.process.wait().expect("it was started").success());
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // A process that has ended already is what we want.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The panel of a simulated rig at `address`, whose cameras are small and slow: the browser needs the computer too.
fn small(address: &str) -> [&str; 12] {
    let cameras = ["--cameras", "sim", "--size", "320x320", "--rate", "2"];
    let [a, b, c, d, e, f] = cameras;
    ["panel", "--port", "sim", "--home", "--listen", address, a, b, c, d, e, f]
}

#[test]
fn people_see_and_drive_the_rig_in_a_browser() {
    let Some((chromium, folder)) = browser() else { return };
    let pictures = pictures();
    let mut served = Served::start(&small("127.0.0.1:0"));
    let address = served.url.trim_start_matches("http://").trim_end_matches('/').to_owned();
    let mut script = Command::new("node")
        .arg(folder.join("browse.mjs"))
        .args([&chromium, &served.url])
        .arg(&pictures)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("node starts");
    let mut answer = script.stdin.take().expect("piped");
    for asked in BufReader::new(script.stdout.take().expect("piped")).lines() {
        match asked.expect("text").as_str() {
            "kill" => served.terminate(),
            "start" => served = Served::start(&small(&address)),
            other => panic!("the script asks for '{other}'"),
        }
        writeln!(answer, "done").expect("the script listens");
    }
    assert!(script.wait().expect("it was started").success(), "the browser found a fault: see above");
    for name in ["desktop", "phone", "light"] {
        assert!(pictures.join(format!("{name}.png")).exists());
    }
}

#[test]
fn people_watch_in_a_browser_how_a_calibration_fills() {
    let Some((chromium, folder)) = browser() else { return };
    let pictures = pictures();
    let set = tempfile::tempdir().expect("a folder");
    let rig = set.path().join("small.toml");
    std::fs::write(&rig, small_bench_toml()).expect("a file");
    let (rig, out) = (rig.to_str().expect("a name"), set.path().join("set"));
    let target = ["--corners", "9x6", "--square", "20mm", "--frames", "120"];
    let capture = ["--rig", rig, "capture", "--cameras", "sim", "--panel", "127.0.0.1:0", "--out"];
    let mut served = Served::start(&[&capture[..], &[out.to_str().expect("a name")], &target].concat());
    let status = Command::new("node")
        .arg(folder.join("capture.mjs"))
        .args([&chromium, &served.url])
        .arg(&pictures)
        .status()
        .expect("node starts");
    assert!(status.success(), "the browser found a fault: see above");
    served.terminate();
    assert!(out.join("right000.png").exists());
}

#[test]
fn other_computers_need_a_flag_and_get_a_token() {
    fails_with(&["--port", "sim", "panel", "--listen", "0.0.0.0:0"], 2, &["--network", "token"]);
    let served = Served::start(&["--port", "sim", "panel", "--cameras", "sim", "--listen", "0.0.0.0:0", "--network"]);
    let token = served.url.split("?token=").nth(1).expect("a token");
    assert!(token.len() == 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()), "{token}");
    let again = Served::start(&["--port", "sim", "panel", "--cameras", "sim", "--listen", "0.0.0.0:0", "--network"]);
    assert!(!again.url.contains(token), "each run has a token of its own");
}
