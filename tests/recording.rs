//! Recordings: what other programs read in them, what a replay makes of them, and what is left when the program dies. Board, stages and cameras are
//! simulated; the live loop, the recording and the readers are the real ones.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::data::skip;
use common::{fails_with, python, run, signal, small_bench_toml, text, vergence};
use serde_json::Value;
use vergence_recording::{Event, Reader};

/// The bench with small cameras.
fn small_bench(folder: &Path) -> PathBuf {
    let path = folder.join("small.toml");
    std::fs::write(&path, small_bench_toml()).expect("a file");
    path
}

fn path_of(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("a name").to_owned()
}

/// The arguments that measure on the simulated bench and record it in `recording`.
fn recorded<'a>(rig: &'a str, recording: &'a str) -> Vec<&'a str> {
    let board = ["--port", "sim", "--rig", rig, "run", "--cameras", "sim", "--home", "--match-time", "100ms"];
    [&board[..], &["--rate", "5", "--record", recording]].concat()
}

/// What the command says, which succeeds.
fn succeeds(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// The size of a recording with two chunks and more, in bytes.
const SOME_CHUNKS: u64 = 2_500_000;

/// How many bytes of a recording are on the disk.
fn size(recording: &str) -> u64 {
    std::fs::metadata(Path::new(recording).join("recording_0.mcap")).map_or(0, |metadata| metadata.len())
}

/// Waits until there are some chunks of a recording, a minute at most.
#[expect(clippy::disallowed_methods, reason = "another process is waited for")]
fn wait_for_chunks(recording: &str) {
    for _ in 0..1200 {
        if size(recording) > SOME_CHUNKS {
            return;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The clouds in a folder, in their order.
fn clouds(folder: &str) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|extension| extension == "ply")).collect();
    files.sort();
    files.iter().map(|file| std::fs::read(file).expect("a file")).collect()
}

#[test]
fn a_recording_is_read_by_other_programs_and_replays_to_the_same_clouds() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rig = small_bench(folder);
    let (recording, live) = (path_of(folder, "recording"), path_of(folder, "live"));
    let arguments = recorded(rig.to_str().expect("a name"), &recording);
    let said = succeeds(&[&arguments[..], &["--frames", "4", "--out", &live, "--keep"]].concat());
    assert!(said.contains("recorded "), "{said}");

    let replays = ["first", "second"].map(|name| {
        let out = path_of(folder, name);
        succeeds(&["replay", &recording, "--out", &out, "--keep"]);
        clouds(&out)
    });
    let live = clouds(&live);
    assert_eq!(live.len(), 4);
    assert_eq!(replays[0], replays[1], "two replays differ");
    assert!(replays[0].len() >= live.len(), "{} clouds replayed, {} live", replays[0].len(), live.len());
    assert_eq!(replays[0][..4], live[..], "a replay differs from what was measured live");

    fails_with(&recorded(rig.to_str().expect("a name"), &recording), 2, &["there is something already"]);
    readable_by_others(Path::new(&recording));
}

/// Two readers of other projects decode every message; written again by one of them, each is the same bytes.
fn readable_by_others(recording: &Path) {
    const READ: &str = r#"
import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore, get_types_from_msg
from mcap_ros2.reader import read_ros2_messages
bag = Path(sys.argv[1])
from mcap.reader import make_reader
store = get_typestore(Stores.EMPTY)
seen = {}
with open(bag / "recording_0.mcap", "rb") as file:
    reader = make_reader(file)
    for schema in reader.get_summary().schemas.values():
        store.register(get_types_from_msg(schema.data.decode(), schema.name))
    assert [a.name for a in reader.iter_attachments()] == ["rig.toml"]
with AnyReader([bag], default_typestore=store) as reader:
    assert len(reader.connections) >= 8, reader.connections
    for connection, stamp, raw in reader.messages():
        message = store.deserialize_cdr(raw, connection.msgtype)
        again = bytes(store.serialize_cdr(message, connection.msgtype))
        assert again == bytes(raw), (connection.topic, len(again), len(raw))
        seen[connection.topic] = seen.get(connection.topic, 0) + 1
    assert reader.message_count == sum(seen.values())
other = sum(1 for _ in read_ros2_messages(str(bag / "recording_0.mcap")))
assert other == sum(seen.values()), (other, seen)
print(seen)
"#;
    let Some(python) = python("import rosbags, mcap_ros2", "rosbags mcap-ros2-support") else { return };
    let output = Command::new(python).args(["-c", READ]).arg(recording).output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("read by rosbags and mcap-ros2-support: {}", seen.trim());
    let topics = [
        "/left/image/compressed",
        "/right/image/compressed",
        "/left/camera_info",
        "/joint_states",
        "/tf",
        "/points",
        "/vergence/events",
    ];
    assert!(topics.iter().all(|topic| seen.contains(topic)), "{seen}");
}

#[test]
fn a_recording_that_was_killed_replays_up_to_its_last_whole_chunk() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rig = small_bench(folder);
    let recording = path_of(folder, "recording");
    let mut child = vergence(&recorded(rig.to_str().expect("a name"), &recording))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    wait_for_chunks(&recording);
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
    println!("killed with {} bytes on the disk", size(&recording));
    assert!(size(&recording) > SOME_CHUNKS, "it recorded nothing");

    let out = path_of(folder, "replayed");
    succeeds(&["replay", &recording, "--out", &out, "--keep", "--frames", "3"]);
    assert_eq!(clouds(&out).len(), 3);
    // The whole of it.
    let whole = vergence(&["replay", &recording, "--from", "1h"]).output().expect("it runs");
    assert!(whole.status.success());
    assert!(text(&whole.stderr).contains("was not finished"), "{}", text(&whole.stderr));
}

/// A disk of three megabytes, where this computer lets one be made; measuring goes on to its end, and what is on the disk replays.
#[test]
fn a_full_disk_ends_with_a_message_and_what_is_on_it_replays() {
    const SCRIPT: &str = r#"
mount -t tmpfs -o size=3m none "$2" 2>&1 || exit 77
"$0" --port sim --rig "$1" run --cameras sim --home --match-time 100ms --rate 5 --frames 20 --record "$2/recording" 2>&1
echo "run ended with $?"
"$0" replay "$2/recording" --out "$3" --keep 2>&1
echo "replay ended with $?"
"#;
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rig = small_bench(folder);
    let [disk, out] = ["disk", "replayed"].map(|name| path_of(folder, name));
    std::fs::create_dir(&disk).expect("a folder");
    let program = env!("CARGO_BIN_EXE_vergence");
    let mut script = Command::new("unshare");
    script.args(["--map-root-user", "--mount", "sh", "-c", SCRIPT, program]).arg(&rig).args([&disk, &out]);
    script.env_remove("VERGENCE_PORT").env_remove("VERGENCE_RIG");
    let Ok(output) = script.output() else { return skip("there is no unshare: install util-linux") };
    let said = text(&output.stdout);
    if output.status.code() == Some(77) || said.is_empty() {
        return skip("this user may not mount a small disk");
    }
    let (run, replay) = said.split_once("run ended with ").expect("it runs");
    assert!(
        run.contains("20 clouds") && run.contains("the disk is full; what was written until now can be replayed"),
        "{said}"
    );
    assert!(replay.starts_with('3') && replay.contains("replay ended with 0"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert!((2..20).contains(&clouds(&out).len()), "{said}");
}

/// A recording of four clouds in `folder`.
fn of_four_clouds(folder: &Path) -> String {
    let rig = small_bench(folder);
    let recording = path_of(folder, "recording");
    let arguments = recorded(rig.to_str().expect("a name"), &recording);
    succeeds(&[&arguments[..], &["--frames", "4"]].concat());
    recording
}

/// The times from the first event to the first and to the last image of a recording.
fn images_within(recording: &str) -> [Duration; 2] {
    let mut reader = Reader::open(Path::new(recording)).expect("a recording");
    let mut events = Vec::new();
    while let Some(heard) = reader.next_event().expect("an event") {
        events.push((heard.host_us, matches!(heard.event, Event::Image(..))));
    }
    let images: Vec<u64> = events.iter().filter(|(_, is_image)| *is_image).map(|(at, _)| *at).collect();
    [images.first(), images.last()].map(|at| Duration::from_micros(at.expect("an image") - events[0].0))
}

/// A replay at a tenth of the pace takes ten times as long as the recording, less what `--from` leaves out, and gives the same clouds.
#[test]
#[expect(clippy::disallowed_methods, reason = "another process is timed")]
fn a_replay_keeps_the_pace_that_it_is_given() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let recording = of_four_clouds(folder);
    let [first, last] = images_within(&recording);
    // The homing before the first image is not waited for.
    let from = first - Duration::from_millis(100);
    let from_text = format!("{}us", from.as_micros());
    let timed = |out: &str, rate: &[&str]| {
        let begun = Instant::now();
        succeeds(&[&["replay", &recording, "--from", &from_text, "--keep", "--out", out], rate].concat());
        begun.elapsed()
    };
    let [fast_out, slow_out] = ["fast", "slow"].map(|name| path_of(folder, name));
    let (fast, slow) = (timed(&fast_out, &[]), timed(&slow_out, &["--rate", "0.1"]));
    println!("images for {:?}; replayed in {fast:?}, at a tenth of the pace in {slow:?}", last - from);
    let expected = (last - from) * 10;
    assert!(slow >= expected, "{slow:?} for {expected:?}");
    // What follows the last image is played at the same pace; it is less than a second.
    assert!(slow < expected + Duration::from_secs(12) + fast, "{slow:?} for {expected:?}");
    assert!(clouds(&slow_out).len() >= 4);
    assert!(clouds(&fast_out) == clouds(&slow_out), "the pace changes the clouds");
    for factor in ["0", "-1", "nan", "fast"] {
        fails_with(&["replay", &recording, &format!("--rate={factor}")], 2, &["is no factor"]);
    }
}

/// Pairs that come faster than they can be matched have fewer points, down to a floor, before fewer of them are measured. What is not measured in
/// real time has all points, however fast it is played.
#[test]
fn time_limits_the_points_of_a_live_run_and_none_of_a_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    let (rig, recording) = (small_bench(folder.path()), of_four_clouds(folder.path()));
    let live = ["--port", "sim", "--rig", rig.to_str().expect("a name"), "run", "--cameras", "sim", "--home"];
    // One core, on which no pair of the views of these images is matched in 28 ms.
    let said = |verb: &[&str], more: &[&str]| {
        let output = vergence(&[verb, more].concat()).env("RAYON_NUM_THREADS", "1").output().expect("the binary runs");
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let clouds = |verb: &[&str], more: &[&str]| -> Vec<Value> {
        let said = said(verb, &[more, &["--json"]].concat());
        let lines = said.lines().map(|line| serde_json::from_str(line).expect("JSON"));
        lines.filter(|line: &Value| line["kind"] == "cloud").collect()
    };
    let fast = ["--rate", "30", "--least-points", "120", "--frames"];
    let limited = clouds(&live, &[&fast[..], &["16"]].concat());
    let limits: Vec<_> = limited.iter().map(|line| line["points_limit"]["most"].as_u64()).collect();
    println!("{limits:?}");
    assert_eq!(limits[0], Some(350), "what a pair costs is not known yet: the rate alone bounds the first one");
    assert!(limits[6..].iter().all(|most| most.is_some_and(|most| (120..700).contains(&most))), "{limits:?}");
    assert!(said(&live, &[&fast[..], &["8"]].concat()).contains(" of 700, "), "people are told too");
    let is_free = |line: &Value| line["points_limit"].is_null();
    assert!(clouds(&live, &["--rate", "1", "--frames", "8"]).iter().all(is_free), "there is time enough");
    let replayed = clouds(&["replay", &recording], &["--rate", "1000"]);
    assert!(replayed.len() >= 4 && replayed.iter().all(is_free));
}

#[test]
fn a_replay_on_a_page_gives_the_same_clouds() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let recording = of_four_clouds(folder);
    let [plain_out, shown_out] = ["plain", "shown"].map(|name| path_of(folder, name));
    succeeds(&["replay", &recording, "--out", &plain_out, "--keep"]);
    let plain = clouds(&plain_out);
    let count = plain.len().to_string();
    let page = ["--panel", "127.0.0.1:0", "--rate", "1000", "--frames", &count];
    let said = succeeds(&[&["replay", &recording, "--out", &shown_out, "--keep"], &page[..]].concat());
    assert!(said.contains("the panel is at http://127.0.0.1:"), "{said}");
    assert!(plain == clouds(&shown_out), "the page changes the clouds");
    fails_with(&["replay", &recording, "--panel", "0.0.0.0:0"], 2, &["--network"]);
    fails_with(&["replay", &recording, "--network"], 2, &["--panel"]);
}

#[test]
fn a_looped_replay_gives_the_same_clouds_until_it_is_interrupted() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let recording = of_four_clouds(folder);
    let [once, twice] = ["once", "twice"].map(|name| path_of(folder, name));
    succeeds(&["replay", &recording, "--out", &once, "--keep"]);
    let once = clouds(&once);
    let count = (2 * once.len()).to_string();
    succeeds(&["replay", &recording, "--out", &twice, "--keep", "--loop", "--frames", &count]);
    // Not by assert_eq, which would print all bytes.
    assert!(clouds(&twice) == [once.clone(), once.clone()].concat(), "the second time gives other clouds");
    // A recording without a result ends.
    succeeds(&["replay", &recording, "--loop", "--from", "1h"]);

    let mut command = vergence(&["--json", "replay", &recording, "--loop"]);
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut said = BufReader::new(process.stdout.take().expect("piped"));
    for _ in 0..=once.len() {
        let mut line = String::new();
        said.read_line(&mut line).expect("a cloud");
        assert!(line.contains("\"cloud\""), "{line}");
    }
    signal(process.id(), "-INT");
    let mut rest = String::new();
    said.read_to_string(&mut rest).expect("it ends");
    let ended = process.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}", text(&ended.stderr));
    let last: Value = serde_json::from_str(rest.lines().last().expect("a last line")).expect("JSON");
    assert_eq!(last["kind"], "end");
    assert!(last["clouds"].as_u64().is_some_and(|clouds| clouds > once.len() as u64), "{last}");
}

/// What is recorded without measuring replays to the clouds that were not measured; nothing of them is in the recording.
#[test]
fn what_is_recorded_without_measuring_can_be_measured_later() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rig = small_bench(folder);
    let rig = rig.to_str().expect("a name");
    let [recording, out, timed] = ["recording", "replayed", "timed"].map(|name| path_of(folder, name));
    let record = ["--port", "sim", "--rig", rig, "record", "--cameras", "sim", "--home", "--rate", "5"];
    let said = succeeds(&[&record[..], &["--frames", "3", "--out", &recording]].concat());
    assert!(said.contains("recorded 6 images"), "{said}");
    let bytes = std::fs::read(Path::new(&recording).join("recording_0.mcap")).expect("a file");
    let holds = |topic: &str| bytes.windows(topic.len()).any(|window| window == topic.as_bytes());
    assert!(holds("/joint_states") && !holds("/points"));
    succeeds(&["replay", &recording, "--out", &out, "--keep"]);
    assert_eq!(clouds(&out).len(), 3, "not every pair has its readings");

    // Two seconds at five images each.
    succeeds(&[&record[..], &["--seconds", "2", "--out", &timed]].concat());
    let [first, last] = images_within(&timed);
    assert!((1500..2000).contains(&(last - first).as_millis()), "{first:?} to {last:?}");
    fails_with(&[&record[..], &["--out", &timed]].concat(), 2, &["there is something already"]);
    fails_with(&["record", "--cameras", "sim"], 2, &["--out"]);
}

#[test]
fn an_interrupted_recording_ends_in_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rig = small_bench(folder);
    let recording = path_of(folder, "recording");
    let mut command =
        vergence(&["--port", "sim", "--rig", rig.to_str().expect("a name"), "record", "--cameras", "sim"]);
    command.args(["--home", "--json", "--out", &recording]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let process = command.spawn().expect("it starts");
    wait_for_chunks(&recording);
    signal(process.id(), "-INT");
    let ended = process.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}", text(&ended.stderr));
    let last: Value = serde_json::from_str(text(&ended.stdout).lines().last().expect("a last line")).expect("JSON");
    assert!(last["images"].as_u64().is_some_and(|images| images > 2), "{last}");
    let replayed = vergence(&["replay", &recording, "--from", "1h"]).output().expect("it runs");
    assert!(replayed.status.success() && !text(&replayed.stderr).contains("was not finished"));
}
