//! The pose of a robot that stands, refined by one pair of rendered images after the other: as uncertain as stated after one, three and
//! ten pairs of the same view, and at its second visit to a mode. Corridor, joints and images are simulated; the lenses are known exactly.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

use std::collections::BTreeMap;
use std::sync::Arc;

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_pipeline::{Method, Observation, PairCloud, PairImages, PairPose, PoseMemory, observe_pair};
use vergence_rig::{Rig, RigCalibration, RigPose};
use vergence_scene::{CorridorPlan, Scene};
use vergence_sim::{Random, Room, RoomCamera};
use vergence_vision::{Angle, Length, Side, Transform};

/// Width of the images: half of the real ones, which takes a quarter of the time.
const WIDTH: u32 = 640;

/// The robot of the rig file.
fn robot() -> Rig {
    let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot");
    rig.with_sensors(WIDTH).expect("a sensor")
}

/// A robot that visits a mode, its joints off by their play when they read it.
struct Visit<'a> {
    rig: &'a Rig,
    stated: RigPose,
    truth: RigPose,
    room: Arc<Room>,
    seed: u64,
}

impl<'a> Visit<'a> {
    /// The robot `seed` somewhere in a random corridor, its right camera off in its mount by what the rig file states. At each visit it stands
    /// elsewhere, its joints off by other play.
    fn new(rig: &'a Rig, mode: &str, (seed, number): (u64, u64)) -> Self {
        let mut random = Random::new(1_000 * seed + 11 + 100 * number);
        let values: Vec<f64> = rig.mode(mode).expect("a mode").targets.iter().map(|target| target.value()).collect();
        let mut truth = rig.pose_at_values(&off_by_play(rig, &values, &mut random));
        let mut off = Random::new(77 + seed);
        let RigCalibration::Sigmas { rotation, translation } = rig.calibration else {
            panic!("the file states sigmas")
        };
        let turn = UnitQuaternion::from_scaled_axis(off.vector(rotation.rad()));
        let (shift, pose) = (off.vector(translation.mm()), truth.left_from_right);
        truth.left_from_right = Transform::new(turn * pose.rotation(), pose.origin().mm() + shift);
        let scene = Scene::of_corridor(&CorridorPlan::random(60_000 + 500 * number + seed));
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), random.between(-0.3, 0.3));
        let place = Vector3::new(random.between(-80.0, 80.0), 0.0, random.between(-200.0, 900.0));
        let room = Arc::new(Room { scene, world_from_base: Transform::new(turn, place) });
        Self { rig, stated: rig.pose_at_values(&values), truth, room, seed: 1_000 * seed + 100 * number }
    }

    /// The images of the pair `number`, with noise of their own.
    fn photograph(&self, number: u32) -> [RgbImage; 2] {
        [Side::Left, Side::Right].map(|side| {
            let (lens, room) = (*self.rig.camera(side), Arc::clone(&self.room));
            RoomCamera { side, lens, room, seed: self.seed }.photograph(&self.truth, number)
        })
    }

    /// Measures a pair as the live loop does.
    fn measure(&self, [left, right]: &[RgbImage; 2], memory: &mut PoseMemory) -> PairCloud {
        let matcher = GuidedMatcher::default();
        let method = Method::from(&matcher as &dyn Matcher);
        let (images, pose) = (PairImages { left, right }, PairPose::standing(self.stated.clone()));
        match observe_pair(images, self.rig, &pose, method, memory).expect("a cloud") {
            Observation::Points { cloud, .. } => *cloud,
            Observation::Bearings { .. } => panic!("two cameras are there"),
        }
    }
}

/// Positions of the axes off by the play of the rig file, corners by that of a passive joint too.
fn off_by_play(rig: &Rig, values: &[f64], random: &mut Random) -> Vec<f64> {
    let (trunk, mut truly) = (rig.trunk.as_ref().expect("a trunk"), values.to_vec());
    for (joint, &axis) in trunk.axes.iter().enumerate() {
        let passive = if joint < 3 { trunk.passive_play } else { 0.0 };
        truly[axis] += 0.5 * rig.axes[axis].play.hypot(passive) * random.normal();
    }
    truly
}

/// Sums over trials of what clouds show.
#[derive(Default)]
struct Figures {
    count: f64,
    nees: f64,
    error: f64,
    sigma: f64,
    points: f64,
    /// Components of the pose that were known before the images.
    known: f64,
}

impl Figures {
    fn add(&mut self, cloud: &PairCloud, truth: &RigPose) {
        let Some(fused) = &cloud.fused_pose else { panic!("the images tell nothing") };
        let way = fused.way_to(&truth.left_from_right);
        self.count += 1.0;
        self.nees += way.dot(&fused.covariance.cholesky().expect("a covariance").solve(&way));
        self.error += way.fixed_rows::<3>(0).norm_squared();
        self.sigma += fused.rotation_sigma().rad().powi(2);
        self.points += cloud.points.len() as f64;
        self.known += fused.told_by_joints();
    }

    fn nees(&self) -> f64 {
        self.nees / self.count
    }

    /// Standard deviation of the rotation, in degrees.
    fn sigma(&self) -> f64 {
        (self.sigma / self.count).sqrt().to_degrees()
    }

    fn print(&self, what: &str) {
        println!(
            "{what}: NEES {:.2} of 6, rotation off by {:.4}, stated {:.4} deg; {:.0} points ({} trials)",
            self.nees(),
            (self.error / self.count).sqrt().to_degrees(),
            self.sigma(),
            self.points / self.count,
            self.count
        );
    }
}

fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

#[test]
fn the_pose_of_a_standing_robot_is_as_uncertain_as_stated_after_each_pair() {
    let (trials, rig) = (seeds(1), robot());
    let pairs = if trials > 1 { 10 } else { 3 };
    for mode in ["gecko", "spider"] {
        let mut figures = BTreeMap::<u32, Figures>::new();
        for seed in 0..trials {
            let (visit, mut memory) = (Visit::new(&rig, mode, (seed, 0)), PoseMemory::default());
            for number in 0..pairs {
                let cloud = visit.measure(&visit.photograph(number), &mut memory);
                figures.entry(number + 1).or_default().add(&cloud, &visit.truth);
            }
        }
        for (pairs, figures) in figures.iter().filter(|(pairs, _)| [1, 3, 10].contains(*pairs)) {
            figures.print(&format!("{mode} after {pairs} pairs"));
        }
        // Ten pairs of one view say little more than one, and must not pretend it.
        let (first, last) = (&figures[&1], &figures[&pairs]);
        assert!(last.sigma() > 0.4 * first.sigma(), "{} {}", last.sigma(), first.sigma());
        assert!(last.nees() < 6.0 * (1.0 + 3.0 * (2.0 / (6.0 * trials as f64)).sqrt()), "{}", last.nees());
    }
}

/// Cameras that were mounted by eye: a visit tells the next one of the same mode how they are mounted, where play does not hide it.
#[test]
fn a_visit_to_a_mode_tells_the_next_one_as_much_as_stated() {
    let trials = seeds(1);
    let by_eye = RigCalibration::Sigmas { rotation: Angle::from_deg(1.0), translation: Length::from_mm(2.0) };
    let rig = Rig { calibration: by_eye, ..robot() };
    let mut figures = BTreeMap::<(&str, u64), Figures>::new();
    let mut alone = BTreeMap::<&str, Figures>::new();
    for seed in 0..trials {
        let mut memory = PoseMemory::default();
        for number in 0..2 {
            for mode in ["gecko", "spider"] {
                let visit = Visit::new(&rig, mode, (seed, number));
                let images = visit.photograph(0);
                let cloud = visit.measure(&images, &mut memory);
                // Gecko is a dead centre: play hides there what a visit could tell.
                assert_eq!(cloud.told_by_visits as u64, if mode == "gecko" { 0 } else { number });
                figures.entry((mode, number)).or_default().add(&cloud, &visit.truth);
                if cloud.told_by_visits > 0 {
                    let without = visit.measure(&images, &mut PoseMemory::default());
                    alone.entry(mode).or_default().add(&without, &visit.truth);
                }
            }
        }
    }
    for ((mode, number), of_visit) in &figures {
        of_visit.print(&format!("{mode}, visit {}", number + 1));
        assert!(of_visit.nees() < 6.0 * (1.0 + 3.0 * (2.0 / (6.0 * trials as f64)).sqrt()), "{}", of_visit.nees());
    }
    for (mode, without) in &alone {
        without.print(&format!("{mode}, visit 2 by itself"));
        let second = &figures[&(*mode, 1)];
        println!(
            "{mode}: {:.2} and {:.2} of 6 known before",
            second.known / second.count,
            without.known / without.count
        );
        assert!(second.known > 1.2 * without.known, "{mode}: nothing is known of the first visit");
        // What matches state of themselves differs from pair to pair more than a visit tells: the gain shows over many trials.
        assert!(trials < 12 || second.sigma() < without.sigma(), "{mode}: the first visit makes the second no better");
    }
}
