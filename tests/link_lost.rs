//! The link to the board ends while `run` measures: the last pose is used, less and less surely, and the board is reached again. Stages, board,
//! cable, room and cameras are simulated; controller, protocol and live loop are the real ones.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::process::Output;

use common::{small_bench_toml, text, vergence};
use serde_json::{Value, json};
use vergence_recording::{Event, Reader};

/// Runs the simulated bench for `seconds` with these options.
fn run(options: &[&str], seconds: &str) -> (Output, Vec<Value>) {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, small_bench_toml()).expect("written");
    let mut command =
        vergence(&["--port", "sim", "--rig", rig.to_str().expect("a name"), "--json", "run", "--cameras", "sim"]);
    let output = command.args(["--home", "--rate", "2", "--match-time", "100ms", "--for", seconds]).args(options);
    let output = output.output().expect("the binary runs");
    let lines = text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    (output, lines)
}

/// What `lines` tell of the rungs of the ladder, in turn.
fn steps(lines: &[Value]) -> Vec<(&str, bool)> {
    let told = lines.iter().filter(|line| line["kind"] == "status");
    told.map(|line| (line["rung"].as_str().expect("a rung"), line["lost"] == true)).collect()
}

/// The clouds among `lines`.
fn clouds(lines: &[Value]) -> Vec<&Value> {
    lines.iter().filter(|line| line["kind"] == "cloud").collect()
}

/// Standard deviation of the rotation between the cameras, in radians.
fn rotation_sigma(cloud: &Value) -> f64 {
    cloud["pose_source"]["rotation_sigma_deg"].as_f64().expect("a sigma")
}

/// Standard deviation of the length of the baseline, along x, in millimetres.
fn baseline_sigma(cloud: &Value) -> f64 {
    cloud["pose_source"]["covariance"][3][3].as_f64().expect("a variance").sqrt()
}

#[test]
fn run_uses_the_last_pose_less_and_less_surely_and_reaches_the_board_again() {
    let (output, lines) = run(&["--unplug", "link@2s..5s"], "8s");
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let clouds = clouds(&lines);
    for cloud in &clouds {
        println!("{} {} {}", cloud["link_lost_s"], cloud["pose_source"], cloud["axes"]);
    }
    let unseen: Vec<_> = clouds.iter().map(|cloud| cloud["link_lost_s"].as_f64()).collect();
    let first = unseen.iter().position(Option::is_some).expect("clouds without a link");
    let last = unseen.iter().rposition(Option::is_some).expect("clouds without a link");
    assert!(first > 0 && last + 1 < unseen.len(), "there is a link before and after: {unseen:?}");
    assert!(unseen[first..=last].windows(2).all(|pair| pair[0] < pair[1]), "{unseen:?}");
    assert!(unseen[last] > Some(1.5), "{unseen:?}");
    // Nobody watches the axes. The images tell the rotation after a while, but not the length of the baseline.
    let sigmas = |sigma: fn(&Value) -> f64| [0, first, last, last + 1].map(|index| sigma(clouds[index]));
    let [known, unseen, _, known_again] = sigmas(rotation_sigma);
    assert!(unseen > 2.0 * known && (known_again - known).abs() < 1e-9, "{unseen} {known}");
    let [known, early, late, known_again] = sigmas(baseline_sigma);
    println!("sigma of the baseline: {known:.4} mm with a link, {early:.4} to {late:.4} mm without");
    assert!(
        known < early && 2.0 * early < late && (known_again - known).abs() < 1e-9,
        "{known} {early} {late} {known_again}"
    );
    for cloud in &clouds {
        let is_told = cloud["without"].as_array().is_some_and(|rungs| rungs.contains(&json!("link_lost")));
        assert_eq!(is_told, cloud["link_lost_s"].is_number(), "{}", cloud["without"]);
    }
    assert_eq!(steps(&lines), [("link_lost", true), ("link_lost", false)]);
    for word in ["the link to the board ended", "connected again", "the link to the board is back"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

/// Nothing is measured while the stages brake unseen; then the images tell them. The board that is back tells them again, and moves nothing.
#[test]
fn axes_that_moved_when_the_link_ended_are_told_by_the_images() {
    let (output, lines) =
        run(&["--mode", "human", "--mode", "herbivore", "--stay", "500ms", "--unplug", "link@2600ms..8s"], "11s");
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let clouds = clouds(&lines);
    for cloud in &clouds {
        let told = &cloud["pose_source"];
        println!(
            "{} {} {}; {} points, {} of the matches agree, {} pairs",
            cloud["moving"],
            cloud["axes_by_images"],
            cloud["axes"],
            cloud["points"],
            told["agreeing_matches"],
            told["pairs"]
        );
    }
    let by_images = |cloud: &&&Value| cloud["axes_by_images"]["separation"].is_object();
    let told: Vec<_> = clouds.iter().filter(by_images).collect();
    let end = clouds.last().expect("clouds");
    let skipped = &lines.last().expect("an end")["skipped"];
    println!("{skipped}");
    assert!(!told.is_empty() && skipped["link_ended"].as_u64() >= Some(3), "{skipped}");
    assert!(end["axes_by_images"].as_object().is_none_or(serde_json::Map::is_empty), "the board is back");
    let separation = |cloud: &Value| cloud["axes"]["separation_deg"].as_f64().expect("an angle");
    assert!((5.0..115.0).contains(&separation(end)), "it braked on the way and stays there: {end}");
    for cloud in told {
        let sigma = cloud["axes_by_images"]["separation"]["sigma"].as_f64().expect("a sigma");
        let off = separation(cloud) - separation(end);
        println!("by images off by {off:.4} ± {sigma:.4} degrees");
        assert!(off.abs() < 4.0 * sigma && sigma < 0.5, "{off} {sigma}");
    }
}

/// After ten seconds without a link nothing is measured, which is told; then all is as before, without a restart.
#[test]
fn run_stops_measuring_after_ten_seconds_and_goes_on_when_the_link_is_back() {
    let (output, lines) = run(&["--unplug", "link@2s..14s"], "17s");
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let unseen: Vec<_> = clouds(&lines).iter().map(|cloud| cloud["link_lost_s"].as_f64()).collect();
    println!("{unseen:?} {}", lines.last().expect("an end")["skipped"]);
    assert!(unseen.iter().flatten().all(|seconds| *seconds <= 10.0) && unseen.last() == Some(&None), "{unseen:?}");
    assert!(lines.last().expect("an end")["skipped"]["link_ended"].as_u64() >= Some(3), "{lines:?}");
    let [down, up] = [true, false];
    let told = [("link_lost", down), ("nothing_measured", down), ("nothing_measured", up), ("link_lost", up)];
    assert_eq!(steps(&lines), told, "{said}");
}

/// `record` goes on too: images come while there is no link, and the recording tells when it ended and came back.
#[test]
fn a_recording_goes_on_without_the_link_and_tells_of_the_gap() {
    let folder = tempfile::tempdir().expect("a folder");
    let name = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let (rig, recording) = (name("rig.toml"), name("recording"));
    std::fs::write(&rig, small_bench_toml()).expect("written");
    let verb = ["--port", "sim", "--rig", &rig, "--json", "record", "--cameras", "sim", "--out", &recording];
    let record = |options: &[&str]| vergence(&[&verb[..], &["--home", "--rate", "2"], options].concat()).output();
    let output = record(&["--for", "8s", "--unplug", "link@2s..5s"]).expect("the binary runs");
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    let end: Value = serde_json::from_str(text(&output.stdout).lines().last().expect("an end")).expect("JSON");
    let gap = end["link_lost_s"].as_f64().expect("seconds");
    assert!((2.5..4.5).contains(&gap) && said.contains("readings and pulses of"), "{end} {said}");
    let (mut reader, mut heard) = (Reader::open(recording.as_ref()).expect("a recording"), Vec::new());
    while let Some(next) = reader.next_event().expect("an event") {
        heard.push(next.event);
    }
    let place = |wanted: &Event| heard.iter().position(|event| event == wanted).expect("it is recorded");
    let (ended, back) = (place(&Event::LinkEnded), place(&Event::LinkBack));
    let images = |events: &[Event]| events.iter().filter(|event| matches!(event, Event::Image(..))).count();
    let pulses = |events: &[Event]| events.iter().filter(|event| matches!(event, Event::Pulse(_))).count();
    let parts = [&heard[..ended], &heard[ended..back], &heard[back..]];
    println!("images {:?}, pulses {:?}", parts.map(images), parts.map(pulses));
    assert!(parts.iter().all(|part| images(part) >= 4), "{:?}", parts.map(images));
    assert!(pulses(parts[0]) > 0 && pulses(parts[1]) == 0 && pulses(parts[2]) > 0, "{:?}", parts.map(pulses));
    // Its replay uses the last pose, as `run` would have done.
    let replayed = vergence(&["replay", &recording, "--json"]).output().expect("the binary runs");
    let lines: Vec<Value> =
        text(&replayed.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let unseen: Vec<_> = clouds(&lines).iter().map(|cloud| cloud["link_lost_s"].is_number()).collect();
    assert!(unseen.contains(&true) && unseen.last() == Some(&false), "{unseen:?} {}", text(&replayed.stderr));

    let other = name("other");
    let verb = ["--port", "sim", "--rig", &rig, "record", "--cameras", "sim", "--home", "--out", &other, "--for", "4s"];
    let ended = vergence(&[&verb[..], &["--unplug", "link@1s..9s", "--no-reconnect"]].concat()).output();
    assert_eq!(ended.expect("the binary runs").status.code(), Some(3));
}

#[test]
fn run_ends_with_the_link_where_it_is_told_to() {
    let (output, _) = run(&["--unplug", "link@1s..5s", "--no-reconnect"], "8s");
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
}
