//! The robot's trunk calibrated by the command line, from corners that a simulated trunk shows: built otherwise than drawn, with play
//! in its joints that no encoder sees and loads that change from shape to shape. Trunk, corners and their noise are simulated.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::fmt::Write;

use common::{fails_with, run_json};
use nalgebra::{Isometry3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use serde_json::Value;
use vergence_plant::servo::{Mechanism, ServoMoment};
use vergence_protocol::Counts;
use vergence_rig::linkage::{CameraMount, TrunkCameras, TrunkLinks};
use vergence_rig::{JointsAt, Rig};
use vergence_sim::{Play, Trunk, TrunkMechanics};
use vergence_vision::{KannalaBrandt, Left, Pixel, Point, Right, Transform};

const RIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/rigs/origaker.toml");
/// Side of the target's squares in millimetres, and its inner corners.
const SQUARE: f64 = 20.0;
const CORNERS: [u32; 2] = [8, 5];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn drawn() -> Rig {
    Rig::from_toml(&std::fs::read_to_string(RIG).expect("the robot's file")).expect("a rig")
}

/// Numbers from -1 to 1, evenly and about normally distributed.
struct Dice(u64);

impl Dice {
    fn new(seed: u64) -> Self {
        let mut dice = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5eed);
        (0..8).for_each(|_| _ = dice.uniform());
        dice
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.uniform()).sum()
    }
}

/// A trunk as it was really built.
struct Built {
    links: TrunkLinks,
    cameras: TrunkCameras,
    /// What a joint's true position is more than its encoder says, in radians: A, B, C, rear fold, front fold.
    zeros: [f64; 5],
    play: [Play; 5],
}

/// Where a servo's output stands, what its encoder counts, and the relative pose that the trunk then has.
struct Shown {
    counts: [i32; 5],
    left_from_right: Transform<Left, Right>,
}

impl Built {
    /// Off the drawing by its tolerances, in normal numbers.
    fn of_seed(seed: u64, dice: &mut Dice) -> Self {
        let drawn = drawn().trunk.expect("a trunk");
        let tolerance = drawn.tolerance;
        let mut mount = |mount: &CameraMount| CameraMount {
            along: mount.along + tolerance.mount_position * dice.normal(),
            outward: mount.outward + tolerance.mount_position * dice.normal(),
            height: mount.height + tolerance.mount_position * dice.normal(),
            angle: mount.angle + tolerance.mount_angle * dice.normal(),
            tilt: mount.tilt + tolerance.mount_angle * dice.normal(),
            roll: mount.roll + tolerance.mount_angle * dice.normal(),
        };
        let (left, right) = (mount(&drawn.cameras.left), mount(&drawn.cameras.right));
        let links = TrunkLinks {
            side: drawn.links.side + tolerance.length * dice.normal(),
            half_end: drawn.links.half_end + tolerance.length * dice.normal(),
            fold_offset: drawn.links.fold_offset + tolerance.length * dice.normal(),
        };
        Self {
            links,
            cameras: TrunkCameras { side: links.side, left, right },
            zeros: std::array::from_fn(|_| tolerance.joint_zero * dice.normal()),
            play: Play::of_seed(seed),
        }
    }

    /// The trunk after a move from spider, with its encoders near `positions` in radians: A, B, C, rear fold, front fold. It is some
    /// time since the last move, and the load of each joint is another one: gravity and cables in another posture (assumed).
    fn at(&self, positions: [f64; 5], released: bool, dice: &mut Dice) -> Shown {
        let per_count = std::f64::consts::TAU / 4096.0;
        let loads: [f64; 5] = std::array::from_fn(|_| 0.3 * dice.uniform());
        let mut trunk =
            Trunk::built((self.links, self.cameras), TrunkMechanics { loads, ..TrunkMechanics::default() }, self.play);
        let mut outputs: [f64; 5] =
            std::array::from_fn(|joint| positions[joint] + 0.5 * per_count * dice.uniform() + self.zeros[joint]);
        let seconds = 1000.0 * (1.0 + dice.uniform());
        let held = outputs;
        let mut torques = [0.0; 5];
        let mut go = |trunk: &mut Trunk, outputs: [f64; 5], from: [f64; 5]| {
            for step in 1..=80 {
                let share = f64::from(step.min(60)) / 60.0;
                let angle = |joint: usize| from[joint] + share * (outputs[joint] - from[joint]);
                let moments =
                    std::array::from_fn::<_, 5, _>(|joint| ServoMoment { angle: angle(joint), velocity: 0.0 });
                trunk.torques(seconds, &moments, &mut torques);
            }
            assert!(trunk.closure_error() < 1e-9);
        };
        let from = trunk.outputs();
        go(&mut trunk, held, from);
        if released {
            // Without torque each servo turns to where its joint leaves it, at its side of the play.
            let free = trunk.outputs();
            let free = std::array::from_fn(|joint| free[joint] + self.play[joint].at(seconds, loads[joint]));
            let before = trunk.corners();
            go(&mut trunk, free, held);
            let moved = before.iter().zip(trunk.corners()).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            assert!(moved < 0.5_f64.to_radians(), "the trunk stays where it is: {moved}");
            outputs = free;
        }
        Shown {
            counts: std::array::from_fn(|joint| ((outputs[joint] - self.zeros[joint]) / per_count).floor() as i32),
            left_from_right: trunk.left_from_right(),
        }
    }
}

/// The pixel of every corner, off by 0.1 px; `None` where one is not seen.
fn seen(
    lens: &KannalaBrandt,
    camera_from_left: &Isometry3<f64>,
    target: &[Vector3<f64>],
    dice: &mut Dice,
) -> Option<Vec<Pixel>> {
    let corner = |at: &Vector3<f64>| {
        let point = camera_from_left * Point3::from(*at);
        let exact = lens.project_point(&Point::<Left>::from_mm(point.coords)).ok().filter(|p| lens.on_sensor(*p))?;
        Some(Pixel { u: exact.u + 0.1 * dice.normal(), v: exact.v + 0.1 * dice.normal() })
    };
    target.iter().map(corner).collect()
}

/// Corner `index` on the target, in millimetres.
fn corner_mm(index: u32) -> [f64; 2] {
    [f64::from(index % CORNERS[0]) * SQUARE, f64::from(index / CORNERS[0]) * SQUARE]
}

/// A target somewhere between the optical axes, in the left frame.
fn target(left_from_right: &Transform<Left, Right>, dice: &mut Dice) -> Vec<Vector3<f64>> {
    let right_axis = left_from_right.rotation() * Vector3::z();
    let middle = (Vector3::z() + right_axis).normalize();
    let towards = (middle + 0.5 * Vector3::new(dice.uniform(), dice.uniform(), dice.uniform())).normalize();
    let tilt = UnitQuaternion::from_euler_angles(0.6 * dice.uniform(), 0.6 * dice.uniform(), dice.uniform());
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &towards).expect("not opposite") * tilt;
    let centre = towards * (330.0 + 100.0 * dice.uniform());
    let half = [0, 1].map(|side: usize| 0.5 * f64::from(CORNERS[side] - 1) * SQUARE);
    let corner = |index: u32| {
        let [x, y] = corner_mm(index);
        Vector3::new(x - half[0], y - half[1], 0.0)
    };
    (0..CORNERS[0] * CORNERS[1]).map(|index| centre + rotation * corner(index)).collect()
}

/// Corners and readings of `views` targets at each of the shapes in degrees.
fn csv(built: &Built, shapes: &[[f64; 5]], views: usize, dice: &mut Dice) -> String {
    let rig = drawn();
    let trunk = rig.trunk.as_ref().expect("a trunk");
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm");
    rig.axes.iter().for_each(|axis| write!(text, ",{}", axis.column()).expect("text"));
    text.push('\n');
    let mut frame = 0;
    for shape in shapes {
        let shown = built.at(shape.map(f64::to_radians), true, dice);
        let mut readings = String::new();
        for (index, axis) in rig.axes.iter().enumerate() {
            let joint = trunk.axes.iter().position(|&axis| axis == index).expect("a joint");
            write!(readings, ",{}", axis.value_at(f64::from(shown.counts[joint])).to_degrees()).expect("text");
        }
        let mut taken = 0;
        while taken < views {
            let target = target(&shown.left_from_right, dice);
            let left = seen(&rig.left_camera, &Isometry3::identity(), &target, dice);
            let right = seen(&rig.right_camera, shown.left_from_right.inverse().isometry(), &target, dice);
            let (Some(left), Some(right)) = (left, right) else { continue };
            for (name, pixels) in [("left", left), ("right", right)] {
                for (index, pixel) in (0_u32..).zip(&pixels) {
                    let [x, y] = corner_mm(index);
                    writeln!(text, "{name},f{frame}.png,{frame},{index},{},{},{x},{y}{readings}", pixel.u, pixel.v)
                        .expect("text");
                }
            }
            (taken, frame) = (taken + 1, frame + 1);
        }
    }
    text
}

/// Shapes far apart: the modes, bent to both sides, and folded. A, B, C, rear fold, front fold in degrees.
const SHAPES: [[f64; 5]; 14] = [
    [90.0, 180.0, 90.0, 180.0, 180.0],
    [120.0, 120.0, 120.0, 180.0, 180.0],
    [170.0, 20.0, 170.0, 180.0, 180.0],
    [105.0, 150.0, 105.0, 180.0, 180.0],
    [150.0, 60.0, 150.0, 180.0, 180.0],
    [110.0, 130.0, 110.0, 180.0, 180.0],
    [95.0, 150.0, 105.0, 180.0, 180.0],
    [125.0, 95.0, 120.0, 180.0, 180.0],
    [115.0, 120.0, 105.0, 180.0, 180.0],
    [140.0, 95.0, 125.0, 180.0, 180.0],
    [130.0, 100.0, 130.0, 180.0, 180.0],
    [100.0, 150.0, 95.0, 180.0, 180.0],
    [120.0, 120.0, 120.0, 150.0, 150.0],
    [140.0, 80.0, 140.0, 140.0, 140.0],
];

/// Of one seed: the result of the command, and in each mode the way from the stated to the true pose and the covariance stated.
struct Trial {
    result: Value,
    modes: Vec<Compared>,
    /// The same by the drawing.
    drawn: Vec<Compared>,
}

struct Compared {
    mode: String,
    way: Vector6<f64>,
    covariance: Matrix6<f64>,
}

impl Compared {
    fn nees(&self) -> f64 {
        self.covariance.cholesky().map_or(f64::INFINITY, |factors| self.way.dot(&factors.solve(&self.way)))
    }

    fn turn(&self) -> f64 {
        self.way.fixed_rows::<3>(0).norm().to_degrees()
    }

    fn shift(&self) -> f64 {
        self.way.fixed_rows::<3>(3).norm()
    }
}

/// The trunk sent to each mode by `rig`, and how far it then is from where `rig` states its right camera.
fn compare(rig: &Rig, built: &Built, dice: &mut Dice) -> Vec<Compared> {
    let trunk = rig.trunk.as_ref().expect("a trunk");
    let per_count = rig.axes[0].value_per_count();
    let modes = rig.modes.iter().map(|mode| {
        let counts = |axis: usize| rig.axes[axis].counts_at(mode.targets[axis].value());
        // Where the drawing, whose zeros are none, has these counts.
        let positions = trunk.axes.map(|axis| (counts(axis) + 0.5) * per_count);
        let shown = built.at(positions, false, dice);
        let mut read = vec![Counts(0); 5];
        trunk.axes.iter().zip(shown.counts).for_each(|(&axis, counts)| read[axis] = Counts(counts));
        let stated = rig.pose(&JointsAt::latched(&read));
        let (from, to) = (stated.left_from_right, shown.left_from_right);
        let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
        let shift = to.origin().mm() - from.origin().mm();
        let way = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        Compared { mode: mode.name.clone(), way, covariance: stated.covariance() }
    });
    modes.collect()
}

fn trial(seed: u64, shapes: &[[f64; 5]]) -> Trial {
    let mut dice = Dice::new(seed);
    let built = Built::of_seed(seed, &mut dice);
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (corners, out) = (file("corners.csv"), file("rig.toml"));
    std::fs::write(&corners, csv(&built, shapes, 6, &mut dice)).expect("written");
    let result = run_json(&["--rig", RIG, "calibrate", "stage", "--json", "--csv", &corners, "--out", &out]);
    let rig = Rig::from_toml(&std::fs::read_to_string(&out).expect("a rig file")).expect("a rig");
    let modes = compare(&rig, &built, &mut dice);
    Trial { result, modes, drawn: compare(&drawn(), &built, &mut dice) }
}

fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Bounds of the mean of `trials` sums of six squared normal errors, between which three such means all lie in 95 of 100 cases (the
/// approximation of E. Wilson and M. Hilferty, PNAS 17, 1931).
fn band(trials: u64) -> [f64; 2] {
    let share = 2.0 / (9.0 * 6.0 * trials as f64);
    [-2.39, 2.39].map(|quantile| 6.0 * (1.0 - share + quantile * share.sqrt()).powi(3))
}

/// The number called `name` among the parameters of a result.
fn of_parameter(result: &Value, name: &str, figure: &str) -> f64 {
    let parameters = result["parameters"].as_array().expect("a list");
    let parameter = parameters.iter().find(|parameter| parameter["name"] == name);
    number(&parameter.unwrap_or_else(|| panic!("no {name}"))[figure])
}

/// By command line and files, from corners to the pose of new shapes.
#[test]
fn a_calibrated_trunk_is_as_far_off_as_its_file_states() {
    let seeds = seeds(8);
    let trials: Vec<Trial> = (0..seeds).map(|seed| trial(seed, &SHAPES)).collect();
    println!(
        "mode: rotation and position of the right camera off, by the drawing; calibrated; as stated; mean NEES of {seeds}"
    );
    for mode in 0..trials[0].modes.len() {
        let after = || trials.iter().map(|trial| &trial.modes[mode]);
        let before = || trials.iter().map(|trial| &trial.drawn[mode]);
        let stated =
            |first: usize| rms(after().map(|mode| mode.covariance.fixed_view::<3, 3>(first, first).trace().sqrt()));
        let [drawn, found] = [rms(before().map(Compared::turn)), rms(after().map(Compared::turn))];
        let nees = after().map(Compared::nees).sum::<f64>() / seeds as f64;
        println!(
            "{}: {drawn:.2} deg {:.2} mm; {found:.3} deg {:.3} mm; {:.3} deg {:.3} mm; {nees:.2}",
            trials[0].modes[mode].mode,
            rms(before().map(Compared::shift)),
            rms(after().map(Compared::shift)),
            stated(0).to_degrees(),
            stated(3),
        );
        let [low, high] = band(seeds);
        assert!((low..high).contains(&nees), "{nees} is not within {low} to {high}");
        // At the dead centre play alone turns the cameras by a degree.
        let least = if trials[0].modes[mode].mode == "gecko" { 3.0 } else { 20.0 };
        assert!(found < drawn / least, "{found} deg against {drawn} deg drawn");
    }
}

/// Where the readings hardly tell the shape, they count for what they are.
#[test]
fn a_shape_at_the_dead_centre_does_no_harm() {
    let off = |shapes: &[[f64; 5]]| {
        let trials: Vec<Trial> = (0..6).map(|seed| trial(seed, shapes)).collect();
        [1, 2].map(|mode: usize| rms(trials.iter().map(|trial| trial.modes[mode].turn())))
    };
    let (with, without) = (off(&SHAPES), off(&SHAPES[1..]));
    println!("spider, stick-bug: {with:?} with a gecko shape, {without:?} without, degrees");
    for (with, without) in with.into_iter().zip(without) {
        assert!(with < 1.25 * without, "{with} with a gecko shape, {without} without");
    }
}

/// Two cameras tell nothing of the base, and only a trunk that folds shows how far the folds are off its plane: the drawing decides the
/// rest, and the result says so.
#[test]
fn the_result_says_how_much_of_each_number_the_images_told() {
    let [folding, flat] = [&SHAPES[..], &SHAPES[..12]].map(|shapes| trial(1, shapes).result);
    let told = |result: &Value, name: &str| of_parameter(result, name, "from_images");
    for parameter in folding["parameters"].as_array().expect("a list") {
        let name = parameter["name"].as_str().expect("a name");
        let sigma = number(&parameter["sigma"]);
        println!("{name}: {:.2}, of flat shapes {:.2}; sigma {sigma:.3}", told(&folding, name), told(&flat, name));
        assert!(sigma <= number(&parameter["tolerance"]) * 1.0001, "{name}: no worse than drawn");
    }
    // The scale of the links is that of the target, and nothing else.
    assert!(told(&folding, "side link") < 0.3 && told(&flat, "fold offset") < 0.05);
    for mount in ["left mount, height", "right mount, height"] {
        assert!(told(&flat, mount) < 0.7 && told(&folding, mount) > 0.9, "{mount}");
    }
    assert!(told(&folding, "right mount, tilt") > 0.99);
    // The front corner's zero trades with the left mount's direction.
    assert!(told(&folding, "zero of the front corner") < 0.97);
}

#[test]
fn two_shapes_are_too_few() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let corners = work.path().join("corners.csv").to_string_lossy().into_owned();
    let mut dice = Dice::new(2);
    let built = Built::of_seed(2, &mut dice);
    std::fs::write(&corners, csv(&built, &SHAPES[..2], 3, &mut dice)).expect("written");
    let out = work.path().join("rig.toml").to_string_lossy().into_owned();
    fails_with(
        &["--rig", RIG, "calibrate", "stage", "--csv", &corners, "--out", &out],
        2,
        &["2 stage poses", "at least 3"],
    );
    assert!(!std::path::Path::new(&out).exists(), "no file without a calibration");
}
