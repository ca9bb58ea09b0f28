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
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::browser::{browser, pictures};
use common::served::Served;
use common::{fails_with, small_bench_toml, text, vergence};
use vergence_rig::BENCH_TOML;

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
            "kill" => drop(served.terminate()),
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

/// The cable is pulled for a while: pages say so, orders are refused, and the board is reached again without a restart.
#[test]
fn people_see_in_a_browser_that_the_link_is_lost_and_back() {
    let Some(browser) = browser() else { return };
    let mut served = Served::start(&[&small("127.0.0.1:0")[..], &["--unplug", "link@25s..40s"]].concat());
    watch("link.mjs", &browser, &served.url);
    let said = served.terminate();
    let end: serde_json::Value = serde_json::from_str(said.lines().last().expect("an end")).expect("JSON");
    assert!(end["clouds"].as_u64() > Some(5), "{end}");
}

#[test]
fn people_watch_in_a_browser_how_a_calibration_fills() {
    let Some(browser) = browser() else { return };
    let set = tempfile::tempdir().expect("a folder");
    let rig = set.path().join("small.toml");
    std::fs::write(&rig, small_bench_toml()).expect("a file");
    let (rig, out) = (rig.to_str().expect("a name"), set.path().join("set"));
    let target = ["--corners", "9x6", "--square", "20mm", "--frames", "120"];
    let capture = ["--rig", rig, "capture", "--cameras", "sim", "--panel", "127.0.0.1:0", "--out"];
    let mut served = Served::start(&[&capture[..], &[out.to_str().expect("a name")], &target].concat());
    watch("capture.mjs", &browser, &served.url);
    served.terminate();
    assert!(out.join("right000.png").exists());
}

/// Runs the script of a browser on the page of a verb.
fn watch(script: &str, (chromium, folder): &(String, PathBuf), url: &str) {
    let status = Command::new("node")
        .arg(folder.join(script))
        .args([chromium, url])
        .arg(pictures())
        .status()
        .expect("node starts");
    assert!(status.success(), "the browser found a fault: see above");
}

#[test]
fn people_watch_a_recording_in_a_browser_hold_it_and_play_it_from_elsewhere() {
    let Some(browser) = browser() else { return };
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_str().expect("a name").to_owned();
    let (rig, recording) = (file("small.toml"), file("recording"));
    std::fs::write(&rig, small_bench_toml()).expect("a file");
    let run =
        ["--rig", &rig, "--port", "sim", "run", "--cameras", "sim", "--home", "--match-time", "100ms", "--rate", "5"];
    let moves = ["--mode", "herbivore", "--mode", "human", "--for", "6s", "--record", &recording];
    let output = vergence(&[&run[..], &moves].concat()).output().expect("it runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    // So slow that a browser beside much other work sees more of it than its end.
    let mut served = Served::start(&["replay", &recording, "--panel", "127.0.0.1:0", "--rate", "1.5"]);
    watch("replay.mjs", &browser, &served.url);
    let said = served.terminate();
    assert!(said.contains("\"end\""), "{said}");
}

#[test]
fn people_watch_in_a_browser_how_a_rig_calibrates_itself() {
    let Some(browser) = browser() else { return };
    let work = tempfile::tempdir().expect("a folder");
    let file = |name: &str| work.path().join(name).to_str().expect("a name").to_owned();
    let (rig, set, out) = (file("small.toml"), file("set"), file("rig.toml"));
    let drawing = BENCH_TOML.replace("[1280, 1280]", "[480, 480]").replace("366.0", "137.0").replace("639.5", "239.5");
    std::fs::write(&rig, drawing).expect("a file");
    let stage = ["--rig", &rig, "calibrate", "stage", "--corners", "7x5", "--square", "30mm", "--set", &set];
    let live = [
        "--port",
        "sim",
        "--live",
        "--cameras",
        "sim",
        "--poses",
        "3",
        "--views",
        "4",
        "--seed",
        "3",
        "--lease",
        "1s",
        "--out",
        &out,
    ];
    let mut served = Served::start(&[&stage[..], &live, &["--panel", "127.0.0.1:0"]].concat());
    watch("stage.mjs", &browser, &served.url);
    let said = served.terminate();
    assert!(said.contains("\"verdict\"") && Path::new(&out).exists(), "{said}");
    fails_with(&[&stage[..], &["--out", &out, "--panel"]].concat(), 2, &["--live"]);
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
