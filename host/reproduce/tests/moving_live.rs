//! What the live loop states of points and pose while the simulated stages move at full speed, against the exact truth. Lenses are traced and
//! known by the rig file that their calibration gives; shutters roll; cameras are fired by the board; poses come from its encoders, matches from
//! the matcher that `vergence run` uses.
//!
//! `VERGENCE_SEEDS=50` for the long run: each seed has its own calibration, noise, stages and reaction of the cameras to the trigger.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use common::count;
use nalgebra::{Matrix3x2, Vector3, Vector6};
use tokio::sync::mpsc;
use vergence_board::{Board, Shared};
use vergence_live::{Limits, LiveError, LiveLoop, LiveResult, MatchingTime, Measurement, Totals, drive};
use vergence_matching::TrackingMatcher;
use vergence_pipeline::{ColouredPoint, Exposures, Observation};
use vergence_protocol::{Mode, Request, SessionId, Trigger};
use vergence_reproduce::LensedRig;
use vergence_rig::{AxisPosition, BENCH_TOML, Rig, RigPose};
use vergence_scene::{Lens, LensChoice, TrueLens};
use vergence_sim::{LiveCamera, Random, Room, RoomCamera, SimulatedRig};
use vergence_vision::{Angle, FusedPose, Length, LensField, Pixel, Side};

const WIDTH: u32 = 480;
/// From the first to the last row 19.2 ms, as long as 1280 rows of the real camera take.
const LINE_TIME: &str = "40us";
const PERIOD_US: u32 = 100_000;
/// Both stages go at full speed after this time.
const TO_SPEED: Duration = Duration::from_millis(600);
/// Results of a way: both stages are at full speed during all of them.
const RESULTS: u64 = 4;
/// Longest reaction of a camera to its trigger, as the live loop assumes it.
const REACTION_US: f64 = 1_000.0;
/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object nobody knows which surface a keypoint belongs to: there the range changes by this part within so many pixels.
const EDGE: f64 = 0.03;
const AROUND_PX: f64 = 1.0;

/// The bench with small cameras and rolling shutters.
fn drawn() -> Rig {
    let rolling = BENCH_TOML.replace("theta_max", &format!("line_time = \"{LINE_TIME}\"\ntheta_max"));
    let scale = 1280.0 / f64::from(WIDTH);
    let rig = Rig::from_toml(&rolling).expect("the bench").with_sensors(WIDTH).expect("small sensors");
    assert!((rig.shutters[0].line_us() - 40.0).abs() < 1e-9 && scale > 1.0, "{:?}", rig.shutters);
    rig
}

fn pose(baseline_mm: f64, separation_deg: f64) -> [AxisPosition; 2] {
    [AxisPosition::Linear(Length::from_mm(baseline_mm)), AxisPosition::Rotary(Angle::from_deg(separation_deg))]
}

/// A rig of its own for each seed: as it is, and as its calibration knows it.
struct World {
    drawn: Rig,
    known: Rig,
    lenses: [TrueLens; 2],
    room: Arc<Room>,
    seed: u64,
    reaction: Duration,
}

impl World {
    fn new(seed: u64) -> Self {
        let drawn = drawn();
        let lens: LensChoice = "sigma8_f18".parse().expect("a lens");
        let LensedRig { lenses, file, .. } = LensedRig::new(&drawn, lens, seed).expect("it is calibrated");
        // As the file states it, which is what `run` reads.
        let known = Rig::from_toml(&file.expect("a file")).expect("a rig");
        assert_eq!(known.shutters, drawn.shutters);
        let known = known.measuring_in(LensField::Measured).expect("the lenses' errors are known");
        let reaction = Duration::from_secs_f64(REACTION_US * 1e-6 * Random::new(seed ^ 0xfeed).between(0.0, 1.0));
        Self { drawn, known, lenses, room: Arc::new(Room::with_rig()), seed, reaction }
    }

    /// The relative errors of points and poses of a run from one place to another.
    async fn measured(&self, [from, to]: [[AxisPosition; 2]; 2]) -> Found {
        let simulated = Shared::new(SimulatedRig::new(&self.drawn, self.seed).expect("a simulated rig"));
        let board = Board::in_process(simulated.clone(), self.known.clone(), SessionId(7), 1000).await;
        let mut board = board.expect("a board");
        board.compare_clocks().await.expect("the link holds");
        board.armed(pending(), async |board| board.home().await).await.expect("homed");
        let (listener, events) = mpsc::channel(16);
        let clock = board.client().clock();
        for (side, (lens, shutter)) in
            [Side::Left, Side::Right].into_iter().zip(self.lenses.iter().cloned().zip(self.drawn.shutters))
        {
            let camera = RoomCamera { side, lens, room: Arc::clone(&self.room), seed: self.seed };
            let camera = LiveCamera::new(camera, shutter, &[]).reacting_after(self.reaction);
            tokio::spawn(drive(camera, simulated.clone(), clock, listener.clone()));
        }
        let mut live = LiveLoop {
            rig: Arc::new(self.known.clone()),
            matcher: Arc::new(TrackingMatcher::default()),
            search: Arc::default(),
            memory: Arc::default(),
            events,
            marks: Some(board.client_mut().take_marks()),
            board: Some(board.client().knowledge()),
            clock,
            exposures: Exposures::new(Some(f64::from(PERIOD_US))),
            matching_time: MatchingTime::Fixed(Duration::from_millis(50)),
            stopwatch: || Duration::ZERO,
        };
        let (mut found, mut totals) = (Found::default(), Totals::default());
        let moved = board.armed(pending(), async |board| -> Result<(), vergence_board::BoardError> {
            board.move_to(Mode(0), &from).await?;
            let gone = tokio::time::timeout(TO_SPEED, board.move_to(Mode(0), &to)).await;
            board.ask(Request::SetTrigger(Trigger::Every { period_us: PERIOD_US })).await?;
            let publish = |result: LiveResult<'_>| {
                self.judge(result.measurement, &simulated, &mut found);
                Ok::<(), LiveError>(())
            };
            let limits = Limits { results: Some(RESULTS), time: Some(Duration::from_secs(20)) };
            live.run(limits, &mut totals, publish, |notice| println!("{notice}")).await.expect("it measures");
            if gone.is_err() { board.stop().await } else { Ok(()) }
        });
        moved.await.expect("it moves");
        assert_eq!(totals.clouds, RESULTS, "{totals:?}");
        found
    }

    fn judge(&self, measurement: &Measurement, simulated: &Shared<SimulatedRig>, found: &mut Found) {
        let Observation::Points { cloud, pose, moving, .. } = &measurement.observation else { panic!("two cameras") };
        let history = simulated.lock().history().clone();
        let middle = measurement.middle.us - measurement.middle.error_us + self.reaction.as_secs_f64() * 1e6;
        let at = |us: f64| history.pose_at(&self.drawn, us).expect("remembered");
        let line_us = self.drawn.shutters[0].line_us();
        let row_us = |pixel: Pixel| middle + (pixel.v - 0.5 * (f64::from(WIDTH) - 1.0)) * line_us;
        let truth = Truth { world: self, middle: at(middle), at: &|pixel| at(row_us(pixel)) };
        for point in &cloud.points {
            truth.judge(point, found);
        }
        let stated = FusedPose {
            left_from_right: pose.left_from_right,
            covariance: pose.covariance(),
            correction: Vector6::zeros(),
            told_by_images: 0.0,
            agreeing: 1.0,
            variance_factor: 1.0,
        };
        let way = stated.way_to(&truth.middle.left_from_right);
        let solved = stated.covariance.cholesky().expect("a covariance").solve(&way);
        found.poses.push(way.dot(&solved));
        found.moving += u64::from(*moving);
    }
}

/// Where both cameras were at one exposure.
struct Truth<'a> {
    world: &'a World,
    middle: RigPose,
    at: &'a dyn Fn(Pixel) -> RigPose,
}

impl Truth<'_> {
    /// What the left pixel shows, in the world, by the row's own pose.
    fn shown(&self, pixel: Pixel) -> Option<Vector3<f64>> {
        let (room, (origin, ray)) = (&self.world.room, self.world.lenses[0].light_of(pixel)?);
        let there = room.world_from_camera(Side::Left, &(self.at)(pixel));
        let (origin, ray) = (there * origin, there * ray);
        let hit = room.scene.cast(&origin, &ray)?;
        Some(origin.mm() + ray.vector() * hit.range.mm())
    }

    /// Where the right camera shows a place of the world: the row tells the instant, and the instant the row.
    fn in_right(&self, place: Vector3<f64>, near: Pixel) -> Option<Pixel> {
        let mut pixel = near;
        for _ in 0..6 {
            let there = self.world.room.world_from_camera(Side::Right, &(self.at)(pixel)).inverse();
            pixel = self.world.lenses[1].image_of(&(there * vergence_vision::Point::from_mm(place)))?;
        }
        Some(pixel)
    }

    fn judge(&self, ColouredPoint { point, score, .. }: &ColouredPoint, found: &mut Found) {
        let pixel = point.pixels.left;
        let left = self.world.room.world_from_camera(Side::Left, &self.middle).inverse();
        let in_left = |place: Vector3<f64>| (left * vergence_vision::Point::from_mm(place)).mm();
        let Some(place) = self.shown(pixel) else { return };
        let Some(right) = self.in_right(place, point.pixels.right) else { return };
        let truth = in_left(place);
        let beside = [(AROUND_PX, 0.0), (-AROUND_PX, 0.0), (0.0, AROUND_PX), (0.0, -AROUND_PX)].map(|(du, dv)| {
            let beside = self.shown(Pixel { u: pixel.u + du, v: pixel.v + dv });
            beside.map_or(f64::INFINITY, |place| in_left(place).norm())
        });
        if beside.iter().any(|range| (range - truth.norm()).abs() > EDGE * truth.norm()) {
            found.at_edges += 1;
            return;
        }
        let off_px = (right.u - point.pixels.right.u).hypot(right.v - point.pixels.right.v);
        if off_px > RIGHT_PX {
            found.wrong.push(f64::from(*score));
            return;
        }
        let off = point.point.mm() - truth;
        let towards = truth.normalize();
        let normal = self.middle.left_from_right.origin().mm().cross(&towards).normalize();
        let across = Matrix3x2::from_columns(&[towards, normal]).transpose();
        let (off2, covariance) = (across * off, across * point.covariance * across.transpose());
        found.across.push(off.dot(&normal).powi(2) / normal.dot(&(point.covariance * normal)));
        found.ranges.push(off.dot(&towards).powi(2) / towards.dot(&(point.covariance * towards)));
        found.pairs.push(off2.dot(&covariance.cholesky().expect("a covariance").solve(&off2)));
    }
}

/// What a run found.
#[derive(Default)]
struct Found {
    /// Squared error of each range over its variance, of right matches: of one.
    ranges: Vec<f64>,
    /// The same along the ray and across the epipolar plane together: of two. The truth is what the left pixel shows, so that nothing is off at
    /// right angles to both.
    pairs: Vec<f64>,
    /// The same across the epipolar plane alone: of one.
    across: Vec<f64>,
    /// Scores of wrong matches.
    wrong: Vec<f64>,
    at_edges: u64,
    /// Squared error of each pose over its covariance: of six.
    poses: Vec<f64>,
    /// Exposures while the stages moved.
    moving: u64,
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The mean over seeds of the mean of each, and half the width of its 95 % band by their scatter: points of a seed share their calibration.
fn over_seeds(all: &[Found], of: fn(&Found) -> &[f64]) -> [f64; 2] {
    let means: Vec<f64> = all.iter().map(|found| mean(of(found))).collect();
    let whole = mean(&means);
    let variance = means.iter().map(|value| (value - whole).powi(2)).sum::<f64>() / (means.len() as f64 - 1.0).max(1.0);
    [whole, 1.96 * (variance / means.len() as f64).sqrt()]
}

fn tell(name: &str, all: &[Found]) {
    let points: usize = all.iter().map(|found| found.ranges.len()).sum();
    let wrong: Vec<f64> = all.iter().flat_map(|found| found.wrong.iter().copied()).collect();
    let edges: u64 = all.iter().map(|found| found.at_edges).sum();
    let beyond = all.iter().flat_map(|found| &found.ranges).filter(|nees| **nees > 9.0).count() as f64 / points as f64;
    println!(
        "{name}, {} seeds: {points} right points, {} wrong, {edges} at edges; beyond 3 sigma {beyond:.4}",
        all.len(),
        wrong.len()
    );
    println!("  mean score of wrong ones {:.2}", mean(&wrong));
    for (what, freedom, of) in [
        ("range", 1, (|found| &found.ranges[..]) as fn(&Found) -> &[f64]),
        ("place across the epipolar plane", 1, |found| &found.across[..]),
        ("point", 2, |found| &found.pairs[..]),
        ("pose", 6, |found| &found.poses[..]),
    ] {
        let [nees, half] = over_seeds(all, of);
        println!("  NEES of {what}: {nees:.3} ± {half:.3} of {freedom}");
    }
}

#[tokio::test(start_paused = true)]
async fn points_and_poses_at_full_speed_are_as_uncertain_as_they_state() {
    let (far, near) = (pose(90.0, 17.0), pose(200.0, 103.0));
    let (mut standing, mut moving) = (Vec::new(), Vec::new());
    for seed in 1..=u64::from(count("VERGENCE_SEEDS", 1)) {
        let world = World::new(seed);
        standing.push(world.measured([pose(145.0, 60.0); 2]).await);
        moving.push(world.measured([far, near]).await);
        for (name, all) in [("standing", &standing), ("moving", &moving)] {
            let found = all.last().expect("a run");
            println!(
                "seed {seed} {name}: {} points, range {:.2}, pose {:.2?}, {} wrong, {} at edges",
                found.ranges.len(),
                mean(&found.ranges),
                found.poses,
                found.wrong.len(),
                found.at_edges
            );
        }
        assert_eq!(moving.last().expect("a run").moving, RESULTS, "all of them while it moves");
    }
    tell("standing", &standing);
    tell("moving", &moving);
}
