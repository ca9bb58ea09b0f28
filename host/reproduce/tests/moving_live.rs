//! What the live loop states of points and pose while the simulated stages move at full speed, against the exact truth. Lenses are traced, mounted as
//! badly as calibrations count on, and known by the rig file that their calibration gives; shutters roll; cameras are fired by the board; poses come from its encoders, matches from
//! the matcher that `vergence run` uses.
//!
//! `VERGENCE_SEEDS=50` for the long run: each seed has its own place in the scene, lenses, calibration, noise, stages and reaction of the cameras to
//! the trigger. `VERGENCE_FIRST_SEED` runs a part of them.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;
#[path = "moving_live/figures.rs"]
mod figures;

use std::f64::consts::TAU;
use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use common::{count, way_to_truth};
use figures::{Found, Nees, band, check, mean, tell};
use nalgebra::{Matrix6, SymmetricEigen, UnitQuaternion, Vector3, Vector6};
use tokio::sync::mpsc;
use vergence_board::{Board, Shared};
use vergence_live::{Limits, LiveError, LiveLoop, LiveResult, MatchingTime, Measurement, Totals, drive};
use vergence_matching::TrackingMatcher;
use vergence_pipeline::{ColouredPoint, Exposures, Observation};
use vergence_protocol::{Mode, Request, SessionId, Trigger};
use vergence_reproduce::{LensedRig, own_frame};
use vergence_rig::{AxisPosition, BENCH_TOML, LensField, Rig, RigCalibration, RigPose, Shutter};
use vergence_scene::{Lens, LensChoice, Scene, TrueLens};
use vergence_sim::{LiveCamera, Random, Rendering, Room, RoomCamera, SimulatedRig};
use vergence_vision::{Angle, Length, Pixel, Side, Transform};

const WIDTH: u32 = 480;
/// From the first to the last row 19.2 ms, as long as 1280 rows of the real camera take.
const LINE_TIME: &str = "40us";
const PERIOD_US: u32 = 100_000;
/// Both stages go at full speed after this time.
const TO_SPEED: Duration = Duration::from_millis(600);
/// Results of a way, in the short run and in the long one: both stages are at full speed during all of them.
const RESULTS: [u64; 2] = [2, 4];
/// Longest reaction of a camera to its trigger, as the live loop assumes it.
const REACTION_US: f64 = 1_000.0;
/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object nobody knows which surface a keypoint belongs to: there the range changes by this part within so many pixels.
const EDGE: f64 = 0.03;
const AROUND_PX: f64 = 1.0;
/// So near to an edge windows show two surfaces.
const BESIDE_PX: f64 = 3.0;

fn results() -> u64 {
    RESULTS[usize::from(std::env::var("VERGENCE_SEEDS").is_ok())]
}

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

/// Every fourth rig stands in the corridor, the others in the furnished room.
const fn is_in_corridor(seed: u64) -> bool {
    seed.is_multiple_of(4)
}

/// Where the rig of a seed stands and looks: what windows show there decides how far matches are off.
fn place(seed: u64) -> Room {
    /// Nothing stands nearer to the middle of either scene than half a metre.
    const AWAY_MM: f64 = 120.0;
    const HALF_BASELINE_MM: f64 = 72.5;
    let mut random = Random::new(seed ^ 0x91ace);
    let scene = if is_in_corridor(seed) { Scene::corridor() } else { Scene::room() };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), random.between(0.0, TAU));
    let away = Vector3::from_fn(|_, _| random.between(-AWAY_MM, AWAY_MM));
    Room { scene, world_from_base: Transform::new(turn, away - turn * Vector3::x() * HALF_BASELINE_MM) }
}

/// A rig of its own for each seed: as it is, and as its calibration knows it.
struct World {
    drawn: Rig,
    known: Rig,
    lenses: [TrueLens; 2],
    /// How the frames of both cameras' rays, as they are known, are turned against the true ones.
    turns: [UnitQuaternion<f64>; 2],
    room: Arc<Room>,
    rendering: Rendering,
    seed: u64,
    reaction: Duration,
}

impl World {
    fn calibrated(seed: u64) -> Self {
        let drawn = drawn();
        let lens: LensChoice = "sigma8_f18".parse().expect("a lens");
        let LensedRig { lenses, file, .. } = LensedRig::mounted(&drawn, lens, seed).expect("it is calibrated");
        // As the file states it, which is what `run` reads.
        let known = Rig::from_toml(&file.expect("a file")).expect("a rig");
        assert_eq!(known.shutters, drawn.shutters);
        let known = known.measuring_in(LensField::Measured).expect("the lenses' errors are known");
        // Each exact ray of such a lens takes a search. Quick images, as `run` has them, are as good in the room, but show the fine texture at the end
        // of the corridor less well than a lens does.
        let rendering = if is_in_corridor(seed) { Rendering::Exact } else { Rendering::Quick };
        Self { rendering, ..Self::of(drawn, known, lenses, seed) }
    }

    /// A rig that is known exactly: what is left are the errors of matches, encoders and instants, which a calibration hides.
    fn exact(seed: u64) -> Self {
        let mut drawn = drawn();
        drawn.calibration = RigCalibration::exact();
        let lenses = [drawn.left_camera, drawn.right_camera].map(TrueLens::from);
        Self::of(drawn.clone(), drawn, lenses, seed)
    }

    fn of(drawn: Rig, known: Rig, lenses: [TrueLens; 2], seed: u64) -> Self {
        let reaction = Duration::from_secs_f64(REACTION_US * 1e-6 * Random::new(seed ^ 0xfeed).between(0.0, 1.0));
        let turns = [own_frame(&known.left_camera, &lenses[0]), own_frame(&known.right_camera, &lenses[1])];
        Self { drawn, known, lenses, turns, room: Arc::new(place(seed)), rendering: Rendering::Exact, seed, reaction }
    }

    /// Unknowns of the pose: all six of a calibrated rig, and the two axes of one that is known exactly.
    fn freedom(&self) -> usize {
        if self.known.calibration == RigCalibration::exact() { 2 } else { 6 }
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
            let camera =
                LiveCamera::new(camera, shutter, &[]).with_rendering(self.rendering).reacting_after(self.reaction);
            tokio::spawn(drive(camera, simulated.clone(), clock, listener.clone()));
        }
        let mut live = LiveLoop {
            rig: Arc::new(self.referenced(&board, &simulated)),
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
            budget: None,
            dense: false,
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
            let limits = Limits { results: Some(results()), time: Some(Duration::from_secs(20)) };
            live.run(limits, &mut totals, publish, |notice| println!("{notice}")).await.expect("it measures");
            if gone.is_err() { board.stop().await } else { Ok(()) }
        });
        moved.await.expect("it moves");
        assert_eq!(totals.clouds, results(), "{totals:?}");
        found
    }

    /// The rig that is known. Homing finds its switches to some counts, by the tick in which they are seen; a rig that is known exactly is
    /// known with that. A calibration's errors are a hundred times as large.
    fn referenced(&self, board: &Board, simulated: &Shared<SimulatedRig>) -> Rig {
        let mut known = self.known.clone();
        if self.freedom() == 2 {
            let mut simulated = simulated.lock();
            simulated.run_to_now();
            let now = simulated.now().0 as f64;
            let truth = simulated.history().pose_at(&self.drawn, now).expect("remembered");
            for ((axis, read), truth) in known.axes.iter_mut().zip(board.positions()).zip(&truth.axes) {
                let counts = (truth.value() - read.value()) / axis.value_per_count();
                println!("{}: the reference is off by {counts:.2} counts", axis.name);
                axis.zero += counts.round() * axis.value_per_count();
            }
        }
        known
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
        let way = way_to_truth(&pose.left_from_right, &truth.middle.left_from_right, self.turns);
        found.poses.push(squared(&way, &pose.covariance(), self.freedom()));
        found.moving += u64::from(*moving);
    }
}

/// The squared `way` over its `covariance`, along as many of its largest axes as it has freedom.
fn squared(way: &Vector6<f64>, covariance: &Matrix6<f64>, freedom: usize) -> f64 {
    // A turn as long as the shift of a camera 145 mm away.
    let scale = Vector6::from([145.0, 145.0, 145.0, 1.0, 1.0, 1.0]);
    let scale = Matrix6::from_diagonal(&scale);
    let axes = SymmetricEigen::new(scale * covariance * scale);
    let mut along: Vec<(f64, f64)> = axes
        .eigenvalues
        .iter()
        .zip(axes.eigenvectors.column_iter())
        .map(|(variance, axis)| (*variance, axis.dot(&(scale * way)).powi(2)))
        .collect();
    along.sort_by(|one, other| other.0.total_cmp(&one.0));
    along.iter().take(freedom).map(|(variance, square)| square / variance).sum()
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
        let is_other = |(du, dv): (f64, f64)| {
            let beside = self.shown(Pixel { u: pixel.u + du, v: pixel.v + dv });
            beside.is_none_or(|place| (in_left(place).norm() - truth.norm()).abs() > EDGE * truth.norm())
        };
        let has_edge_within = |px: f64| [(px, 0.0), (-px, 0.0), (0.0, px), (0.0, -px)].into_iter().any(is_other);
        if has_edge_within(AROUND_PX) {
            found.at_edges += 1;
            return;
        }
        let off_px = (right.u - point.pixels.right.u).hypot(right.v - point.pixels.right.v);
        if off_px > RIGHT_PX {
            found.wrong += 1;
            return;
        }
        let turn = self.world.turns[0];
        let off = point.point.mm() - turn * truth;
        let towards = turn * truth.normalize();
        let normal = (turn * self.middle.left_from_right.origin().mm()).cross(&towards).normalize();
        found.across.push(off.dot(&normal).powi(2) / normal.dot(&(point.covariance * normal)));
        let squared = off.dot(&towards).powi(2) / towards.dot(&(point.covariance * towards));
        found.ranges.push(squared);
        if has_edge_within(BESIDE_PX) { &mut found.beside_edges } else { &mut found.elsewhere }.push(squared);
        found.doubts.push(1.0 - f64::from(*score));
    }
}

/// What standing and moving rigs state.
async fn measured(of: fn(u64) -> World) -> [Nees; 2] {
    let (far, near) = (pose(90.0, 17.0), pose(200.0, 103.0));
    let (mut standing, mut moving) = (Vec::new(), Vec::new());
    let first = u64::from(count("VERGENCE_FIRST_SEED", 1));
    for seed in first..first + u64::from(count("VERGENCE_SEEDS", 1)) {
        let world = of(seed);
        standing.push(world.measured([pose(145.0, 60.0); 2]).await);
        moving.push(world.measured([far, near]).await);
        for (name, all) in [("standing", &standing), ("moving", &moving)] {
            let found = all.last().expect("a run");
            println!(
                "seed {seed} {name}: {} points, range {:.2}, pose {:.2?}, {} wrong, {} at edges",
                found.ranges.len(),
                mean(&found.ranges),
                found.poses,
                found.wrong,
                found.at_edges
            );
        }
        assert_eq!(moving.last().expect("a run").moving, results(), "all of them while it moves");
    }
    let freedom = of(1).freedom();
    [tell("standing", &standing, freedom), tell("moving", &moving, freedom)]
}

#[tokio::test(start_paused = true)]
async fn points_and_poses_at_full_speed_are_as_uncertain_as_a_calibrated_rig_states() {
    let [standing, moving] = measured(World::calibrated).await;
    [&standing, &moving].into_iter().for_each(check);
    // Errors of the calibration, which hide those of the motion.
    for nees in [&standing, &moving] {
        assert!((nees.pose[0] - 6.0).abs() < band(6.0), "{:?} of 6", nees.pose);
    }
    let by_chance = 3.0 / f64::from(count("VERGENCE_SEEDS", 1)).sqrt();
    assert!((standing.pose[0] - moving.pose[0]).abs() < by_chance, "motion adds what is not stated");
}

#[tokio::test(start_paused = true)]
async fn points_and_poses_at_full_speed_are_as_uncertain_as_a_known_rig_states() {
    let [standing, moving] = measured(World::exact).await;
    for nees in [&standing, &moving] {
        check(nees);
        assert!((nees.pose[0] - 2.0).abs() < band(2.0), "{:?} of 2", nees.pose);
        assert!((0.4..1.3).contains(&nees.across[0]), "{:?} of 1", nees.across);
    }
    // A rolling shutter that is taken for a global one is noticed.
    let exact = World::exact(1);
    let blind = World { known: Rig { shutters: [Shutter::Global; 2], ..exact.known.clone() }, ..exact };
    let found = blind.measured([pose(90.0, 17.0), pose(200.0, 103.0)]).await;
    println!("with global shutters: {:.1} of 1", mean(&found.ranges));
    assert!(mean(&found.ranges) > 3.0 * moving.range[0], "{}", mean(&found.ranges));
}
