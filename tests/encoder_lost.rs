//! An encoder dies while the live loop measures: the board stops, the images tell the axis, and homing brings the encoder back. Stages,
//! encoders, room and cameras are simulated; controller, protocol and live loop are the real ones. The relative pose is off by what the
//! calibration states.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;
#[path = "common/live_bench.rs"]
mod live_bench;

use std::future::pending;
use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use common::rendered::{band, seeds};
use common::{small_bench_toml, vergence};
use live_bench::{LiveBench, Setting};
use nalgebra::{Isometry3, UnitQuaternion};
use serde_json::Value;
use tokio::sync::Notify;
use vergence::failure::Failure;
use vergence::sim::SharedRig;
use vergence_alignment::FusedPose;
use vergence_board::{Board, BoardError};
use vergence_live::{Limits, LiveLoop, LiveResult, Measurement, Totals, Tour};
use vergence_pipeline::{AxisByImages, Observation, PairCloud};
use vergence_protocol::{Mode as ModeNumber, Refusal, Request, Trigger};
use vergence_rig::{AxisPosition, BENCH_TOML, Chain, Mode, Rig, RigCalibration, RigPose};
use vergence_sim::{Random, Room};
use vergence_vision::{Angle, Length, Transform};

/// Width of the images: three eighths of the real ones, where the pose is judged; a quarter of them elsewhere.
const WIDTH: u32 = 480;
const SMALL: u32 = 320;
const PERIOD_US: u32 = 500_000;
const SEPARATION: usize = 1;
/// Largest number of results of a trial.
const MOST: u64 = 60;

fn drawn(width: u32) -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(width).expect("a sensor")
}

/// The bench as it is: its relative pose is off by what the calibration states.
fn as_built(drawn: &Rig, random: &mut Random) -> Rig {
    let RigCalibration::Sigmas { rotation, translation } = drawn.calibration else {
        panic!("the bench states its goal")
    };
    let turn = UnitQuaternion::from_scaled_axis(random.vector(rotation.rad()));
    let off = Isometry3::from_parts(random.vector(translation.mm()).into(), turn);
    let at_zero = Transform::from_isometry(drawn.right_chain.at_zero().isometry() * off);
    Rig { right_chain: Chain::new(drawn.right_chain.links().to_vec(), at_zero), ..drawn.clone() }
}

fn at(number: u8, separation_deg: f64) -> Mode {
    let baseline = AxisPosition::Linear(Length::from_mm(145.0));
    let targets = vec![baseline, AxisPosition::Rotary(Angle::from_deg(separation_deg))];
    Mode { name: format!("at {separation_deg}"), number: ModeNumber(number), targets }
}

/// A homed bench and a live loop that believes the drawing.
struct Bench {
    simulated: SharedRig,
    built: Rig,
    board: Board,
    live: LiveLoop,
}

impl Bench {
    async fn new(seed: u64, width: u32) -> Self {
        let drawn = drawn(width);
        let built = as_built(&drawn, &mut Random::new(500 + seed));
        let (room, matching) = (Arc::new(Room::with_rig()), Duration::from_millis(150));
        let setting =
            Setting { rigs: [&built, &drawn], room: &room, seeds: [1 + seed, seed], period_us: PERIOD_US, matching };
        let LiveBench { simulated, board, live } = LiveBench::homed(setting).await;
        Self { simulated, built, board, live }
    }

    /// Sends the stages from 20° to 100° and unplugs the encoder of the separation on the way. Measures until `publish` says that it is
    /// enough. Each `order` that it gives homes the axes; what was warned of.
    async fn measure(&mut self, order: &Notify, mut publish: impl FnMut(&Seen<'_>) -> bool) -> Vec<String> {
        let Self { simulated, built, board, live } = self;
        let tour = Tour { modes: vec![at(1, 20.0), at(2, 100.0)], stay: Duration::from_millis(1_100) };
        board.ask(Request::SetTrigger(Trigger::Every { period_us: PERIOD_US })).await.expect("a trigger");
        // At rest at 20 degrees, then on the way.
        let way = simulated.clone();
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(Duration::from_millis(5)).await;
                let degrees = way.lock().true_pose().axes[SEPARATION].mm_or_deg();
                if degrees > 45.0 {
                    way.lock().unplug_encoder(SEPARATION, [Duration::ZERO, Duration::from_secs(3600)]);
                    return;
                }
            }
        });
        let (mut totals, said, mut enough) = (Totals::default(), std::cell::RefCell::new(Vec::new()), false);
        let warn = |warning: String| said.borrow_mut().push(warning);
        let seen = |result: LiveResult<'_>| -> Result<(), Failure> {
            let us = result.measurement.middle.us - result.measurement.middle.error_us;
            let truth = simulated.lock().history().pose_at(built, us).expect("remembered");
            enough |= publish(&Seen::of(result.measurement, truth));
            if enough { Err(Failure::usage("enough")) } else { Ok(()) }
        };
        let limits = Limits { results: Some(MOST), time: Some(Duration::from_secs(60)) };
        tokio::select! {
            ended = live.run(limits, &mut totals, seen, |notice| warn(notice.to_string())) => drop(ended),
            error = tour.drive(Some(board), pending(), async || order.notified().await, warn) => panic!("{error}"),
        }
        println!("{totals:?}");
        assert!(enough, "{totals:?} {:?}", said.borrow());
        said.into_inner()
    }
}

/// A result beside the truth.
struct Seen<'a> {
    cloud: &'a PairCloud,
    pose: &'a RigPose,
    by_images: &'a [AxisByImages],
    truth: RigPose,
}

impl<'a> Seen<'a> {
    fn of(measurement: &'a Measurement, truth: RigPose) -> Self {
        let Observation::Points { cloud, pose, by_images, .. } = &measurement.observation else {
            panic!("two cameras are there")
        };
        Self { cloud, pose, by_images, truth }
    }

    /// Squared error of the pose over its covariance, of six.
    fn of_pose(&self) -> f64 {
        let stated =
            FusedPose { covariance: self.pose.covariance(), ..*self.cloud.fused_pose.as_ref().expect("by images") };
        let way = stated.way_to(&self.truth.left_from_right);
        way.dot(&stated.covariance.cholesky().expect("a covariance").solve(&way))
    }

    /// Error of the separation in degrees, and its standard deviation; by the encoder, where that tells it.
    fn separation(&self) -> [f64; 2] {
        let off = (self.pose.axes[SEPARATION].value() - self.truth.axes[SEPARATION].value()).to_degrees();
        [off, self.by_images.first().map_or(0.0, |told| told.sigma.mm_or_deg())]
    }
}

/// The whole story, over seeds: on by encoders, on by images, homed, on by encoders. The pose by images is as uncertain as stated
/// after one pair, after three and after ten.
#[tokio::test(start_paused = true)]
async fn the_images_stand_in_for_an_encoder_that_dies_on_the_way() {
    let trials = seeds(1);
    // One trial costs seconds for each pair.
    let (last, back) = if trials > 1 { (10, 3) } else { (3, 1) };
    let mut nees: [Vec<f64>; 3] = Default::default();
    let mut of_axis = Vec::new();
    for seed in 0..trials {
        let (mut bench, order) = (Bench::new(seed, WIDTH).await, Notify::new());
        let simulated = bench.simulated.clone();
        let (mut before, mut by_images, mut after) = (0, 0, 0);
        let said = bench
            .measure(&order, |seen| {
                let [off, sigma] = seen.separation();
                if seen.by_images.is_empty() {
                    if by_images == 0 {
                        before += 1;
                    } else {
                        assert!(off.abs() < 0.2, "the encoder is back and tells {off}");
                        after += 1;
                    }
                    return after == back;
                }
                by_images += 1;
                let pairs = seen.cloud.told_by_pairs;
                println!(
                    "seed {seed}: {pairs} pairs, {} points, separation off by {off:.4} ± {sigma:.4}, NEES {:.2}",
                    seen.cloud.points.len(),
                    seen.of_pose()
                );
                assert!(off.abs() < 6.0 * sigma && sigma < 0.2, "{off} {sigma}");
                if let Some(at) = [1, 3, 10].iter().position(|count| *count == pairs) {
                    nees[at].push(seen.of_pose());
                }
                if pairs == 1 {
                    of_axis.push((off / sigma).powi(2));
                }
                if pairs == last {
                    simulated.lock().with_plant(|plant| plant.axis_mut(SEPARATION).expect("a stage").mend_encoder());
                    order.notify_one();
                }
                false
            })
            .await;
        println!("{before} before, {by_images} by images, {after} after; {said:?}");
        assert!(before > 0 && by_images >= last, "{before} {by_images}");
        assert!(said.iter().any(|said| said.contains("separation") && said.contains("images")), "{said:?}");
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let [_, high] = band(trials, 6.0, 2.39);
    for (pairs, of_pose) in [1, 3, 10].into_iter().zip(&nees).filter(|(_, list)| !list.is_empty()) {
        println!("after {pairs} pairs: NEES of the pose {:.2} of 6 ({trials} trials)", mean(of_pose));
        assert!((0.3..high).contains(&mean(of_pose)), "{of_pose:?}");
    }
    println!("separation: {:.2} of 1", mean(&of_axis));
}

/// Nothing moves an axis that no encoder tells, neither with the fault latched nor after it was cleared.
#[tokio::test(start_paused = true)]
async fn an_axis_without_encoder_is_not_moved() {
    let mut bench = Bench::new(9, SMALL).await;
    bench.measure(&Notify::new(), |seen| !seen.by_images.is_empty()).await;
    let board = &mut bench.board;
    let refused = board.arm().await;
    assert!(matches!(&refused, Err(BoardError::Refused { refusal: Refusal::Latched, .. })), "{refused:?}");
    board.next_pose().await.expect("a pose");
    board.clear().await.expect("cleared");
    let moved = board.armed(pending(), async |board| board.move_to(ModeNumber(1), &at(1, 20.0).targets).await).await;
    assert!(matches!(&moved, Err(BoardError::Refused { refusal: Refusal::NotReferenced { .. }, .. })), "{moved:?}");
    assert_eq!(board.client().knowledge().lost_axes().len(), 1, "clearing does not bring it back");
}

/// By the command line: lines by encoders, by images, and after `home` on standard input by encoders again.
#[test]
fn run_goes_on_by_images_and_comes_back_when_told_to_home() {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, small_bench_toml()).expect("written");
    let tour =
        ["--home", "--mode", "human", "--mode", "herbivore", "--stay", "900ms", "--unplug", "separation@3500ms..6s"];
    let pace = ["--rate", "2", "--match-time", "150ms", "--for", "60s"];
    let mut command =
        vergence(&["--port", "sim", "--rig", rig.to_str().expect("a name"), "--json", "run", "--cameras", "sim"]);
    command.args(tour).args(pace).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut process = command.spawn().expect("the binary runs");
    let mut orders = process.stdin.take().expect("piped");
    let lines = BufReader::new(process.stdout.take().expect("piped")).lines();
    let (mut by_images, mut back, mut steps) = (0, 0, Vec::new());
    for line in lines.map_while(Result::ok) {
        let line: Value = serde_json::from_str(&line).expect("JSON");
        if line["kind"] == "status" {
            steps.push((line["rung"].clone(), line["lost"] == true));
        }
        if line["kind"] != "cloud" {
            continue;
        }
        let told = &line["axes_by_images"]["separation"];
        if told.is_object() {
            by_images += 1;
            assert_eq!(line["without"], serde_json::json!(["encoder_lost"]));
            println!("{told} {}", line["pose_source"]["pairs"]);
            assert_eq!(
                (told["unit"].as_str(), line["pose_source"]["from"].as_str()),
                (Some("deg"), Some("joints and images"))
            );
            // The encoder may not be plugged in yet.
            writeln!(orders, "home").expect("it listens");
        } else if by_images > 0 {
            back += 1;
            if back == 2 {
                break;
            }
        }
    }
    process.kill().expect("it runs");
    let mut said = String::new();
    std::io::Read::read_to_string(&mut process.stderr.take().expect("piped"), &mut said).expect("text");
    process.wait().expect("it ends");
    assert!(by_images > 0 && back == 2, "{by_images} {back} {said}");
    assert!(said.contains("separation") && said.contains("home"), "{said}");
    assert_eq!(steps, [("encoder_lost".into(), true), ("encoder_lost".into(), false)], "{said}");
}
