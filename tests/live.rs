//! The live loop on the simulated rig: it measures while the stages move, keeps to the newest pair, and lives with one camera.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;
#[path = "common/live_bench.rs"]
mod live_bench;

use std::collections::BTreeMap;
use std::future::pending;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::Stdio;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use common::dense_files::within_sigma;
use common::{fails_with, run, signal, small_bench_toml, text, vergence};
use live_bench::{LiveBench, Setting};
use serde_json::Value;
use vergence::failure::Failure;
use vergence::sim::SharedRig;
use vergence_board::Board;
use vergence_live::{Limits, LiveLoop, LiveResult, MatchingTime, Measurement, Totals};
use vergence_matching::{ImagePair, MatchError, Matcher, Matches};
use vergence_pipeline::{ColouredPoint, Observation};
use vergence_protocol::{Mode, Request, Trigger};
use vergence_rig::{AxisPosition, Rig, Shutter};
use vergence_scene::LensChoice;
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Angle, Left, Length, Pixel, Side};

/// The bench with small cameras whose rows are exposed one after the other, 20 ms from the first to the last.
fn small_bench() -> String {
    small_bench_toml().replace("theta_max", "line_time = \"62.5us\"\ntheta_max")
}

fn rig() -> Rig {
    Rig::from_toml(&small_bench()).expect("a rig")
}

fn pose(baseline_mm: f64, separation_deg: f64) -> [AxisPosition; 2] {
    [AxisPosition::Linear(Length::from_mm(baseline_mm)), AxisPosition::Rotary(Angle::from_deg(separation_deg))]
}

/// A homed rig with cameras whose rows are exposed as `rig` says, measured as `believed` says.
struct Bench {
    simulated: SharedRig,
    room: Arc<Room>,
    board: Board,
    live: LiveLoop,
    rig: Rig,
}

const PERIOD_US: u32 = 100_000;

impl Bench {
    async fn new(believed: [Shutter; 2], seed: u64) -> Self {
        let rig = rig();
        let room = Arc::new(Room::with_rig());
        let believed = Rig { shutters: believed, ..rig.clone() };
        let matching = Duration::from_millis(50);
        let setting =
            Setting { rigs: [&rig, &believed], room: &room, seeds: [seed, seed + 2], period_us: PERIOD_US, matching };
        let LiveBench { simulated, board, live } = LiveBench::homed(setting).await;
        Self { simulated, room, board, live, rig }
    }

    /// Goes to `from`, and then measures `results` times on the way to `to`, when the stages have reached their speed. The
    /// normalised errors of all ranges.
    async fn errors_on_the_way(mut self, [from, to]: [[AxisPosition; 2]; 2], results: u64) -> Vec<f64> {
        const TO_SPEED: Duration = Duration::from_millis(600);
        let Self { simulated, room, board, live, rig } = &mut self;
        let (mut errors, mut totals) = (Vec::new(), Totals::default());
        board
            .armed(pending(), async |board| -> Result<_, Failure> {
                board.move_to(Mode(0), &from).await?;
                let trigger = Request::SetTrigger(Trigger::Every { period_us: PERIOD_US });
                let mut triggered = Box::pin(board.move_to(Mode(0), &to));
                // The stages go, and nothing is exposed yet.
                let gone = tokio::time::timeout(TO_SPEED, &mut triggered).await;
                drop(triggered);
                board.ask(trigger).await?;
                let publish = |result: LiveResult<'_>| {
                    errors.extend(normalised(result.measurement, simulated, room, rig));
                    Ok::<(), Failure>(())
                };
                let limits = Limits { results: Some(results), time: Some(Duration::from_secs(20)) };
                live.run(limits, &mut totals, publish, |warning| println!("{warning}")).await?;
                if gone.is_err() {
                    board.stop().await?;
                }
                Ok(())
            })
            .await
            .expect("it moves and measures");
        assert_eq!(totals.clouds, results);
        errors
    }
}

/// How far each range is off the truth, in its stated sigma.
fn normalised(measurement: &Measurement, simulated: &SharedRig, room: &Room, rig: &Rig) -> Vec<f64> {
    let Observation::Points { cloud, moving, .. } = &measurement.observation else { panic!("two cameras are there") };
    let history = simulated.lock().history().clone();
    // The camera reacts at once, which nobody told: the middle is stated half a millisecond late, as its bound allows.
    let middle = measurement.middle.us - measurement.middle.error_us;
    let left_at = |us: f64| room.world_from_left(history.pose_at(rig, us).expect("remembered").base_from_left);
    let reference = left_at(middle);
    let error = |ColouredPoint { point, .. }: &ColouredPoint| {
        let pixel = point.pixels.left;
        let row = middle + (pixel.v - 159.5) * rig.shutters[0].line_us();
        let there = left_at(row);
        let ray = there * rig.left_camera.unproject::<Left>(pixel).ok()?;
        let hit = room.scene.cast(&there.origin(), &ray)?;
        let truth = ray.at(hit.range.mm()).mm() + there.origin().mm();
        let range = (truth - reference.origin().mm()).norm();
        Some((point.point.mm().norm() - range) / point.sigma_range.mm())
    };
    let errors: Vec<f64> = cloud.points.iter().filter_map(error).collect();
    println!("{} points, moving: {moving}, median |z| {:.2}", errors.len(), median(&errors));
    errors
}

fn median(errors: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Through the whole of the product: trigger, frames paired with pulses, rolling shutters, encoder stream, matching. Both stages
/// go at full speed in the middle of this way.
#[tokio::test(start_paused = true)]
async fn static_and_moving_clouds_agree_within_what_they_state() {
    let (far, near) = (pose(90.0, 17.0), pose(200.0, 103.0));
    let seeds = std::env::var("VERGENCE_SEEDS").map_or(2, |seeds| seeds.parse().expect("a number"));
    let (mut standing, mut moving) = (Vec::new(), Vec::new());
    for seed in 1..=seeds {
        standing.extend(Bench::new(rig().shutters, seed).await.errors_on_the_way([pose(145.0, 60.0); 2], 2).await);
        moving.extend(Bench::new(rig().shutters, seed).await.errors_on_the_way([far, near], 4).await);
    }
    assert!(standing.len() > 100 && moving.len() > 100, "{} {}", standing.len(), moving.len());
    let within = |errors: &[f64]| errors.iter().filter(|z| z.abs() < 3.0).count() as f64 / errors.len() as f64;
    let nees = |errors: &[f64]| {
        let core: Vec<f64> = errors.iter().filter(|z| z.abs() < 3.0).map(|z| z * z).collect();
        core.iter().sum::<f64>() / core.len() as f64
    };
    println!("within 3 sigma: standing {:.3}, moving {:.3}", within(&standing), within(&moving));
    println!("NEES within 3 sigma, {seeds} seeds: standing {:.2}, moving {:.2}", nees(&standing), nees(&moving));
    // Errors of matches have longer tails than a Gaussian.
    assert!(within(&standing) > 0.94 && within(&moving) > 0.94);
    assert!(median(&moving) < 1.0 && median(&standing) < 1.0);
    // Of a Gaussian cut off at three sigma it is 0.97.
    assert!((0.5..=1.4).contains(&nees(&standing)) && (0.5..=1.4).contains(&nees(&moving)));
    // The check notices a shutter that the rig file does not tell.
    let wrong = Bench::new([Shutter::Global; 2], 1).await.errors_on_the_way([far, near], 1).await;
    assert!(wrong.is_empty() || median(&wrong) > 2.0 * median(&moving), "{}", median(&wrong));
}

fn lines(output: &[u8]) -> Vec<Value> {
    text(output).lines().map(|line| serde_json::from_str(line).expect("JSON Lines")).collect()
}

fn live(folder: &Path, arguments: &[&str]) -> (Vec<Value>, String) {
    let rig = folder.join("rig.toml");
    std::fs::write(&rig, small_bench()).expect("written");
    let all = ["--port", "sim", "--rig", rig.to_str().expect("a name"), "run", "--cameras", "sim", "--home", "--json"];
    let output = run(&[&all, arguments].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let mut lines = lines(&output.stdout);
    lines.retain(|line| line["kind"] != "status");
    (lines, text(&output.stderr))
}

/// Images smaller than the rig file's: no pixel of a cloud lies beyond them, and the lens shows the same field in them.
#[test]
fn simulated_cameras_take_images_of_the_size_that_is_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let name = folder.path().join("out");
    let files = ["--out", name.to_str().expect("a name"), "--also", "csv"];
    let arguments = ["--size", "280x280", "--mode", "human", "--stay", "1s", "--match-time", "10ms", "--frames", "1"];
    let (lines, _) = live(folder.path(), &[&arguments[..], &files].concat());
    assert!(lines[0]["points"].as_u64().is_some_and(|points| points > 20), "{}", lines[0]["points"]);
    let csv = std::fs::read_to_string(name.join("cloud.csv")).expect("a table");
    let columns = |line: &str| -> Vec<f64> { line.split(',').filter_map(|number| number.parse().ok()).collect() };
    let rows: Vec<Vec<f64>> = csv.lines().skip(1).map(columns).collect();
    let pixels = rows.iter().flat_map(|row| &row[6..10]);
    let (low, high) = pixels.fold((f64::INFINITY, 0.0_f64), |(low, high), pixel| (low.min(*pixel), high.max(*pixel)));
    assert!(low >= 0.0 && (200.0..280.0).contains(&high), "{low} to {high}");
    // All points lie in the room of 4 by 2.6 by 5 m.
    assert!(rows.iter().all(|row| row[2] < 4000.0), "a lens of another scale puts them elsewhere");
}

#[test]
fn run_measures_the_newest_pair_while_the_stages_move() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let name = out.to_str().expect("a name");
    let tour = ["--mode", "herbivore", "--mode", "human", "--stay", "100ms"];
    let pace = ["--rate", "20", "--match-time", "700ms", "--frames", "6", "--dense"];
    let (lines, said) = live(folder.path(), &[&tour[..], &pace, &["--out", name, "--also", "csv,json"]].concat());
    let (end, clouds) = lines.split_last().expect("lines");
    assert_eq!(clouds.len(), 6);
    let separations: Vec<f64> =
        clouds.iter().map(|line| line["axes"]["separation_deg"].as_f64().expect("an angle")).collect();
    println!("{separations:?} {}", end["skipped"]);
    let apart = separations.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 1.0).count();
    assert!(apart >= 4, "each from its own exposure: {separations:?}");
    assert!(clouds.iter().any(|line| line["moving"] == true));
    for line in clouds {
        assert_eq!(line["kind"], "cloud");
        assert!(line["points"].as_u64().is_some_and(|points| points > 20), "{}", line["points"]);
        // All pixels are measured by one pose.
        assert!(line["moving"] == false || line["dense"].is_null(), "{}", line["dense"]);
        assert_eq!(line["cloud"]["rows"].as_array().map(Vec::len), line["points"].as_u64().map(|n| n as usize));
        // One frame of 20 ms, its way to the host, at most one waiting for the next pulse, and matching.
        assert!(line["latency_ms"].as_f64().is_some_and(|ms| (700.0..900.0).contains(&ms)), "{}", line["latency_ms"]);
    }
    assert!(clouds[0]["rate_hz"].is_null(), "one result has no rate");
    assert!(clouds[5]["rate_hz"].as_f64().is_some_and(|rate| (1.2..1.5).contains(&rate)), "{}", clouds[5]["rate_hz"]);
    assert_eq!((&clouds[5]["limited_by"], &clouds[5]["without"][0]), (&"matching".into(), &"lower_rate".into()));
    assert!(said.contains("lower rate"), "{said}");
    // Twenty pairs each second, one of which is measured each 0.7 s: the rest is counted, not queued.
    let newer = end["skipped"]["newer_came"].as_u64().expect("counted");
    assert!((60..=95).contains(&newer), "{}", end["skipped"]);
    assert_eq!(end["clouds"], 6);
    let ply = std::fs::read(out.join("cloud.ply")).expect("a cloud");
    let ply = String::from_utf8_lossy(&ply);
    assert!(ply.contains("property uchar red") && ply.contains("sigma_range") && ply.contains("score"));
    let csv = std::fs::read_to_string(out.join("cloud.csv")).expect("a table");
    let points = clouds[5]["points"].as_u64().expect("a number") as usize;
    assert_eq!(csv.lines().count(), points + 1);
    assert!(csv.lines().next().is_some_and(|header| header.ends_with(",track")));
    let json: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("cloud.json")).expect("a table")).expect("JSON");
    assert_eq!(json["rows"].as_array().map(Vec::len), Some(points));
}

/// A rig with traced lenses is calibrated first; clouds by the file that is written agree with the room as those lenses show it.
#[test]
fn traced_lenses_are_measured_live_by_their_calibration() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let pace = ["--match-time", "100ms", "--frames", "2", "--out", out.to_str().expect("a name"), "--dense"];
    let (lines, _) = live(folder.path(), &[&["--lens", "sigma8_f18"], &pace[..]].concat());
    let file = std::fs::read_to_string(out.join("rig.toml")).expect("the calibrated rig");
    let known = Rig::from_toml(&file).expect("a rig");
    assert!(!known.left_camera.is_central() && !known.right_camera.is_central(), "its pupils move");
    let rig = rig();
    let lens = "sigma8_f18".parse::<LensChoice>().expect("a lens").in_place_of(&rig.left_camera).expect("a lens");
    let camera = RoomCamera { side: Side::Left, lens, room: Arc::new(Room::with_rig()), seed: 0 };
    let cloud = &lines[1];
    assert_eq!(cloud["simulated_lens"], "sigma8_f18");
    let at = |axis: &str| cloud["axes"][axis].as_f64().expect("a number");
    let pose = rig.pose_at_values(&[at("baseline_mm"), at("separation_deg").to_radians()]);
    let error = |row: &Value| {
        let n: Vec<f64> = (0..11).map(|column| row[column].as_f64().expect("a number")).collect();
        let truth = camera.true_range(&pose, Pixel { u: n[6], v: n[7] })?.mm();
        Some(((n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt() - truth) / n[10])
    };
    let errors: Vec<f64> = cloud["cloud"]["rows"].as_array().expect("rows").iter().filter_map(error).collect();
    println!("{} points, median |z| {:.2}", errors.len(), median(&errors));
    // The same of every pixel, by the images that are written. A range counts from where the pixel's light crosses the axis, which is less than a
    // millimetre beside the origin. Most pixels of so small an image, from a baseline of 60 mm, are near an edge, as they are with ideal lenses.
    let pixels = (0..320 * 320_u32).map(|index| Pixel { u: (index % 320).into(), v: (index / 320).into() });
    let truth: Vec<f64> = pixels.map(|pixel| camera.true_range(&pose, pixel).map_or(f64::NAN, Length::mm)).collect();
    let [all, far] = within_sigma(&out, &truth, at("baseline_mm") * 91.5);
    println!("within 1 and 2 sigma: {all:?}, far from edges {far:?}; {}", cloud["dense"]);
    assert!(cloud["dense"]["measured"].as_u64().is_some_and(|count| count > 10_000) && out.join("dense.ply").exists());
    assert!(all.pixels > 40_000 && all.one > 0.57 && all.two > 0.8, "{all:?}");
    assert!(far.pixels > 5_000 && (0.63..0.78).contains(&far.one) && (0.92..0.98).contains(&far.two), "{far:?}");
    assert!(errors.len() > 50 && median(&errors) < 1.2, "{} {}", errors.len(), median(&errors));
    let attached = ["--port", "sim", "run", "--cameras", "/dev/video0", "/dev/video1", "--lens", "sigma8_f18"];
    fails_with(&attached, 2, &["--lens is for simulated cameras"]);
}

/// Ctrl-C in mid-move: the stages brake, the board is disarmed, what became of everything is told, and that is no failure.
#[test]
fn an_interrupted_run_ends_cleanly() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, small_bench()).expect("written");
    let tour = ["--home", "--mode", "herbivore", "--mode", "human", "--stay", "1h", "--match-time", "100ms"];
    let mut command = vergence(&["--port", "sim", "--rig", rig.to_str().expect("a name"), "--json", "run"]);
    command.args(["--cameras", "sim"]).args(tour).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut process = command.spawn().expect("the binary runs");
    let mut said = BufReader::new(process.stdout.take().expect("piped"));
    let mut first = String::new();
    said.read_line(&mut first).expect("a cloud");
    assert!(first.contains("\"cloud\""), "{first}");
    signal(process.id(), "-INT");
    let mut rest = String::new();
    said.read_to_string(&mut rest).expect("it ends");
    let ended = process.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}", text(&ended.stderr));
    let last: Value = serde_json::from_str(rest.lines().last().expect("a last line")).expect("JSON");
    assert_eq!(last["kind"], "end");
    assert!(last["clouds"].as_u64().is_some_and(|clouds| clouds > 0));
}

#[test]
fn a_dead_camera_leaves_bearings_and_its_return_clouds() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let name = out.to_str().expect("a name");
    let pace = ["--rate", "10", "--match-time", "250ms", "--seconds", "2.3", "--keep", "--out", name];
    let (lines, said) = live(folder.path(), &[&pace[..], &["--unplug", "left@800ms..1500ms"]].concat());
    let (end, results) = lines.split_last().expect("lines");
    let kinds: Vec<_> = results.iter().map(|line| line["kind"].as_str().expect("a kind")).collect();
    let first = kinds.iter().position(|kind| *kind == "bearings").expect("bearings");
    let last = kinds.iter().rposition(|kind| *kind == "bearings").expect("bearings");
    assert!(first > 0 && last + 1 < kinds.len(), "{kinds:?}");
    assert!(kinds[first..=last].iter().all(|kind| *kind == "bearings"), "{kinds:?}");
    let line = &results[first];
    assert_eq!((line["camera"].as_str(), line["dead"]["camera"].as_str()), (Some("right"), Some("left")));
    assert!(line["without"].as_array().is_some_and(|rungs| rungs.contains(&"camera_lost".into())), "{line}");
    assert!(line["dead"]["why"].as_str().is_some_and(|why| why.contains("unplugged")));
    let rows = line["bearings"]["rows"].as_array().expect("rows");
    assert!(rows.len() > 50, "{}", rows.len());
    for row in rows {
        let number = |column: usize| row[column].as_f64().expect("a number");
        let length = (number(0).powi(2) + number(1).powi(2) + number(2).powi(2)).sqrt();
        assert!((length - 1.0).abs() < 1e-5 && (0.1..1.0).contains(&number(8)), "{row}");
    }
    assert!(said.contains("the left camera is dead") && said.contains("the left camera is there"), "{said}");
    assert_eq!(end["bearings"], last - first + 1);
    let files = |stem: &str| {
        let names = std::fs::read_dir(&out).expect("a folder").map(|entry| entry.expect("an entry").file_name());
        names.filter(|name| name.to_string_lossy().starts_with(stem)).count() as u64
    };
    assert_eq!((Some(files("cloud")), Some(files("bearings"))), (end["clouds"].as_u64(), end["bearings"].as_u64()));
}

/// Of a rig that stands, most points have the number that they had in the cloud before, and still show the same place.
#[test]
fn places_keep_their_numbers_from_cloud_to_cloud() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (lines, _) = live(folder.path(), &["--rate", "10", "--match-time", "50ms", "--frames", "3"]);
    let places = |cloud: &Value| -> BTreeMap<i64, [f64; 2]> {
        let rows = cloud["cloud"]["rows"].as_array().expect("rows").iter();
        let of = |row: &Value| {
            (row[25].as_f64().expect("a track") as i64, [6, 7].map(|i| row[i].as_f64().expect("a pixel")))
        };
        rows.map(of).filter(|(track, _)| *track >= 0).collect()
    };
    let (first, last) = (places(&lines[0]), places(&lines[2]));
    let kept: Vec<_> = first.iter().filter_map(|(track, at)| Some((at, last.get(track)?))).collect();
    println!("{} of {} kept", kept.len(), first.len());
    assert!(first.len() > 50 && kept.len() * 10 > first.len() * 8, "{} of {}", kept.len(), first.len());
    assert!(kept.iter().all(|(one, other)| (one[0] - other[0]).hypot(one[1] - other[1]) < 0.5));
}

/// A matcher that tells when it begins, and finds nothing.
struct Telling(mpsc::Sender<()>);

impl Matcher for Telling {
    fn name(&self) -> &'static str {
        "telling"
    }

    fn find(&self, _: &ImagePair<'_>) -> Result<Matches, MatchError> {
        self.0.send(()).expect("somebody listens");
        Ok(Matches::default())
    }
}

/// What becomes of a result, such as files, takes time too. Here each result waits until the matcher has begun with the next pair.
#[tokio::test(start_paused = true)]
async fn the_next_pair_is_measured_while_a_result_is_written() {
    let mut bench = Bench::new(rig().shutters, 1).await;
    let (tell, begun) = mpsc::channel();
    bench.live.matcher = Arc::new(Telling(tell));
    // Longer than the period: when a pair is done, the next one has come.
    bench.live.matching_time = MatchingTime::Fixed(Duration::from_millis(150));
    bench.board.ask(Request::SetTrigger(Trigger::Every { period_us: PERIOD_US })).await.expect("it fires");
    let (mut totals, mut started) = (Totals::default(), 0);
    let publish = |result: LiveResult<'_>| {
        while started < (result.totals.clouds + 1).min(4) {
            begun.recv_timeout(Duration::from_secs(20)).expect("the next pair is measured meanwhile");
            started += 1;
        }
        Ok::<(), Failure>(())
    };
    let limits = Limits { results: Some(4), time: Some(Duration::from_secs(20)) };
    bench.live.run(limits, &mut totals, publish, |warning| println!("{warning}")).await.expect("it measures");
    assert_eq!((totals.clouds, started), (4, 4));
}
