//! The robot's rig file: a trunk in place of stages.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use vergence_rig::{JointsAt, Provenance, Rig, RigPose, TrunkCovariance};

const ORIGAKER: &str = include_str!("../../../docs/rigs/origaker.toml");

fn rig() -> Rig {
    Rig::from_toml(ORIGAKER).expect("the robot's file")
}

fn at(rig: &Rig, mode: &str) -> RigPose {
    rig.pose_at_values(&values(rig, mode))
}

fn values(rig: &Rig, mode: &str) -> Vec<f64> {
    rig.mode(mode).expect("a mode").targets.iter().map(|target| target.value()).collect()
}

/// Angle between the optical axes in degrees, positive outward, and distance of the cameras in millimetres.
fn separation_and_baseline(pose: &RigPose) -> [f64; 2] {
    let axis = pose.left_from_right.rotation() * Vector3::z();
    [axis.x.atan2(axis.z).to_degrees(), pose.left_from_right.origin().mm().norm()]
}

/// The table of modes, with the cameras 0, 20 and 50 mm from the corners on the links, and as in the file.
#[test]
fn the_modes_have_the_published_separations() {
    for (mode, separation, baselines) in [
        ("gecko", 120.0, [100.0, 100.0, 100.0, 150.0]),
        ("spider", 60.0, [100.0, 120.0, 150.0, 193.3]),
        ("stick-bug", -40.0, [100.0, 139.4, 198.5, 207.2]),
    ] {
        let mounted = |along: &str, outward: &str| {
            let text = ORIGAKER.replace("camera_along = \"50mm\"", &format!("camera_along = \"{along}\""));
            Rig::from_toml(&text.replace("camera_outward = \"25mm\"", &format!("camera_outward = \"{outward}\"")))
        };
        let mounts = [("0mm", "0mm"), ("20mm", "0mm"), ("50mm", "0mm"), ("50mm", "25mm")];
        for ((along, outward), expected) in mounts.into_iter().zip(baselines) {
            let rig = mounted(along, outward).expect("a file");
            let [found, baseline] = separation_and_baseline(&at(&rig, mode));
            assert!((found - separation).abs() < 1e-6, "{mode}: {found}");
            assert!((baseline - expected).abs() < 0.05, "{mode}, {along}, {outward}: {baseline}");
        }
    }
}

/// Left camera in the plane of the trunk: c = (-50, 0) + d (-sin r, -cos r) + o (-cos r, sin r), with r = 90 degrees less half of B, x
/// to the right and y forward; its axis points outward by 60 degrees less r.
#[test]
fn the_cameras_stand_in_the_base_frame() {
    let rig = rig();
    for (mode, b) in [("gecko", 180.0), ("spider", 120.0), ("stick-bug", 20.0)] {
        let pose = at(&rig, mode);
        let (sine, cosine) = f64::to_radians(90.0 - b / 2.0).sin_cos();
        let [right, forward] = [-50.0 - 50.0 * sine - 25.0 * cosine, -50.0 * cosine + 25.0 * sine];
        let at = pose.base_from_left.origin().mm();
        assert!((at.x - right).abs() < 1e-6 && (at.z - forward).abs() < 1e-6, "{mode}: {at}");
        let outward = f64::to_radians(60.0 - (90.0 - b / 2.0));
        let axis = pose.base_from_left.rotation() * Vector3::z();
        assert!((axis - Vector3::new(-outward.sin(), 0.0, outward.cos())).norm() < 1e-6, "{mode}: {axis}");
        let down = pose.base_from_left.rotation() * Vector3::y();
        assert!((down - Vector3::y()).norm() < 1e-9, "{mode}: {down}");
        // The right camera is its mirror image, at the same height.
        let other = (pose.base_from_left * pose.left_from_right).origin().mm();
        assert!((other - Vector3::new(-at.x, at.y, at.z)).norm() < 1e-6, "{mode}: {other}");
    }
}

/// The front fold turns the right half of the trunk about the front link's middle.
#[test]
fn a_fold_rolls_the_cameras_against_each_other() {
    let rig = rig();
    let mut folded = values(&rig, "spider");
    folded[3] -= f64::to_radians(30.0);
    folded[4] -= f64::to_radians(30.0);
    let (flat, folded) = (at(&rig, "spider"), rig.pose_at_values(&folded));
    let base_from_right = |pose: &RigPose| pose.base_from_left * pose.left_from_right;
    let turn = base_from_right(&folded).rotation() * base_from_right(&flat).rotation().inverse();
    assert!((turn.angle().to_degrees() - 30.0).abs() < 1e-6, "{}", turn.angle().to_degrees());
    let axis = turn.axis().expect("a turn");
    assert!(axis.z.abs() > 1.0 - 1e-9, "about the fold, which points forward: {axis:?}");
}

#[test]
fn a_trunk_survives_being_written() {
    let rig = rig();
    let text =
        rig.to_toml(&Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None }).expect("a file");
    assert_eq!(Rig::from_toml(&text).as_ref(), Ok(&rig), "{text}");
    // Left out, a key has the value of the paper's robot.
    let start = ORIGAKER.find("[trunk]").expect("the table") + "[trunk]\n".len();
    let end = ORIGAKER.find("# The lenses").expect("the cameras");
    let bare = format!("{}{}", &ORIGAKER[..start], &ORIGAKER[end..]);
    let found = Rig::from_toml(&bare).expect("a file").trunk.expect("a trunk");
    let written = rig.trunk.expect("a trunk");
    assert_eq!((found.links, found.cameras, found.bodies), (written.links, written.cameras, written.bodies));
}

/// Each camera has six numbers of its own; those of both are what a mount leaves out.
#[test]
fn each_camera_has_a_mount() {
    let tables = "[trunk.left_mount]\nheight = \"8mm\"\ntilt = \"10deg\"\n[trunk.right_mount]\nalong = \"47mm\"\nroll = \"5deg\"\n";
    let text = ORIGAKER.replace("# The lenses of the paper", &format!("{tables}# The lenses"));
    let (plain, found) = (rig(), Rig::from_toml(&text).expect("a file"));
    let [before, after] = [&plain, &found].map(|rig| at(rig, "spider"));
    // y of the base points down, and so does that of a camera: one that looks up sees along -y.
    let raised = after.base_from_left.origin().mm() - before.base_from_left.origin().mm();
    assert!((raised - Vector3::new(0.0, -8.0, 0.0)).norm() < 1e-9, "{raised}");
    let axis = after.base_from_left.rotation() * Vector3::z();
    assert!((axis.y + 10_f64.to_radians().sin()).abs() < 1e-9, "{axis}");
    let [level, rolled] = [before, after].map(|pose| pose.base_from_left * pose.left_from_right);
    let (turn, roll) = (level.rotation().inverse() * rolled.rotation(), Vector3::z() * 5_f64.to_radians());
    assert!((turn.scaled_axis() - roll).norm() < 1e-9, "about its own axis: {turn}");
    // The right front side link runs 60 degrees from straight back to the right: 3 mm less of it.
    let (sine, cosine) = 30_f64.to_radians().sin_cos();
    let shift = rolled.origin().mm() - level.origin().mm();
    assert!((shift - 3.0 * Vector3::new(-sine, 0.0, cosine)).norm() < 1e-9, "{shift}");
    let provenance = Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let written = found.to_toml(&provenance).expect("a file");
    assert_eq!(Rig::from_toml(&written).as_ref(), Ok(&found), "{written}");
}

/// Servo 14 of the robot: its command is 290 degrees less the model's angle.
#[test]
fn an_encoder_has_a_zero_and_a_direction() {
    let text =
        ORIGAKER.replacen("name = \"rear_corner\"", "zero = \"290deg\"\nreversed = true\nname = \"rear_corner\"", 1);
    let (plain, found) = (rig(), Rig::from_toml(&text).expect("a file"));
    let mode = &found.mode("spider").expect("a mode").targets;
    let wire = found.wire_targets(mode);
    assert!((f64::from(wire[1].0) - 170e6_f64.to_radians()).abs() < 1.0, "{wire:?}");
    assert_eq!(found.wire_distances(mode)[1].0, -plain.wire_distances(mode)[1].0);
    let values = values(&found, "spider");
    for (axis, &value) in found.axes.iter().zip(&values) {
        assert!((axis.value_at(axis.counts_at(value)) - value).abs() < 1e-12);
    }
    // A count more is a smaller angle; poses are those of the true angles.
    let step = found.axes[1].value_at(101.0) - found.axes[1].value_at(100.0);
    assert!((step + std::f64::consts::TAU / 4096.0).abs() < 1e-12, "{step}");
    assert_eq!(at(&found, "spider"), at(&plain, "spider"));
    // While all axes move together, the timing's error has the sign of the motion, not of the encoder.
    let moving = |rig: &Rig, sign: f64| {
        let counts = rig.axes.iter().zip(&values).map(|(axis, &value)| axis.counts_at(value)).collect();
        rig.pose(&JointsAt { counts, sigma: vec![0.0; 5], timing: vec![3.0, 3.0 * sign, -5.0, 0.0, 0.0] })
    };
    let apart = (moving(&found, -1.0).covariance() - moving(&plain, 1.0).covariance()).amax();
    assert!(apart < 1e-9, "{apart}");
    let provenance = Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let written = found.to_toml(&provenance).expect("a file");
    assert_eq!(Rig::from_toml(&written).as_ref(), Ok(&found), "{written}");
}

/// A covariance of the trunk's numbers, written and read.
#[test]
fn a_calibrated_trunk_survives_being_written() {
    let mut rig = rig();
    let columns = TrunkCovariance::from_fn(|row, column| 1e-3 * (1.0 + ((row * 7 + column * 3) % 11) as f64));
    let covariance = columns * columns.transpose() + TrunkCovariance::identity() * 1e-6;
    rig.trunk.as_mut().expect("a trunk").covariance = Some(Box::new(covariance));
    let provenance = Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let written = rig.to_toml(&provenance).expect("a file");
    let read = Rig::from_toml(&written).expect(&written);
    let found = read.trunk.and_then(|trunk| trunk.covariance).expect("a covariance");
    assert_eq!(found.lower_triangle(), covariance.lower_triangle());
    let refused = Rig::from_toml(&written.replacen("covariance = [[", "covariance = [[-", 1)).expect_err("negative");
    assert!(refused.to_string().contains("not positive definite"), "{refused}");
    let refused =
        Rig::from_toml(&written.replacen("covariance = [[", "covariance = [[1.0], [", 1)).expect_err("longer");
    assert!(refused.to_string().contains("20 rows"), "{refused}");
}

#[test]
fn bad_trunks_are_refused_with_the_key() {
    let refused = |from: &str, to: &str| {
        assert!(ORIGAKER.contains(from), "{from}");
        Rig::from_toml(&ORIGAKER.replacen(from, to, 1)).expect_err(to).to_string()
    };
    for (from, to, named) in [
        ("side = \"140mm\"", "side = \"0mm\"", "[trunk] side"),
        ("side = \"140mm\"", "side = \"140\"", "[trunk] side"),
        ("camera_angle = \"60deg\"", "camera_angle = \"600deg\"", "[trunk] camera_angle"),
        ("passive_range = [\"8.1deg\"", "passive_range = [\"352deg\"", "[trunk] passive_range"),
        ("passive_play = \"0.2deg\"", "passive_play = \"-0.2deg\"", "[trunk] passive_play"),
        ("speed = \"60deg\"", "speed = \"0deg\"", "[trunk] speed"),
        ("[trunk]\n", "[trunk]\nfront_fold = \"tail\"\n", "no rotary axis 'tail'"),
        ("[trunk]\n", "[trunk]\nfront_fold = \"rear_fold\"\n", "one for each driven joint"),
        ("[trunk]\n", "[trunk]\nsides = 4\n", "sides"),
        ("[trunk]\n", "[trunk]\nleft_mount.tilt = \"10mm\"\n", "[trunk] left_mount.tilt"),
        ("[trunk]\n", "[trunk]\nright_mount.hight = \"10mm\"\n", "hight"),
        ("[trunk]\n", "[trunk]\ntolerance.length = \"0mm\"\n", "[trunk] tolerance.length"),
        ("kind = \"rotary\"", "kind = \"rotary\"\nzero = \"2mm\"", "zero of axis 'front_corner'"),
        ("[left.camera]", "[left.at_zero]\norigin = [\"1mm\", \"0mm\", \"0mm\"]\n[left.camera]", "[left.at_zero]"),
    ] {
        let told = refused(from, to);
        assert!(told.contains(named), "{to}: {told}");
    }
}

/// Random errors of the driven corners, as normal numbers in units of the stated standard deviations, against the stated covariance.
#[test]
fn the_covariance_holds_at_a_dead_centre_and_elsewhere() {
    let rig = rig();
    for (mode, least, most) in [("gecko", 1.0, 8.0), ("spider", 0.1, 0.6), ("stick-bug", 0.1, 0.6)] {
        let nominal = values(&rig, mode);
        let pose = rig.pose_read_at(&nominal);
        assert!((least..most).contains(&pose.rotation_sigma.deg()), "{mode}: {}", pose.rotation_sigma);
        // Play to either side, readings, and a passive joint that turns the loop as well.
        let sigma = rig.axes[0].sigma_with_play(1.0 / 12f64.sqrt()) * rig.axes[0].value_per_count();
        let sigma = sigma.hypot(0.5 * rig.trunk.as_ref().expect("a trunk").passive_play);
        let mut dice = Dice(7);
        let (mut turn, mut shift) = (0.0, 0.0);
        let trials = 4000;
        for _ in 0..trials {
            let moved: Vec<f64> = nominal
                .iter()
                .enumerate()
                .map(|(axis, value)| value + if axis < 3 { sigma * dice.normal() } else { 0.0 })
                .collect();
            let counts = rig.axes.iter().zip(&moved).map(|(axis, &value)| axis.counts_at(value)).collect();
            let none = vec![0.0; 5];
            let truth = rig.pose(&JointsAt { counts, sigma: none.clone(), timing: none });
            let off: UnitQuaternion<f64> = truth.left_from_right.rotation() * pose.left_from_right.rotation().inverse();
            turn += off.angle().powi(2) / f64::from(trials);
            shift += (truth.left_from_right.origin().mm() - pose.left_from_right.origin().mm()).norm_squared()
                / f64::from(trials);
        }
        let stated = |first: usize| pose.covariance().fixed_view::<3, 3>(first, first).trace();
        // The folds add a roll, a few tenths of a degree, to what is stated.
        for (found, stated, what) in
            [(turn.sqrt(), stated(0).sqrt(), "turn"), (shift.sqrt(), stated(3).sqrt(), "shift")]
        {
            assert!(found < 1.1 * stated && found > 0.6 * stated, "{mode}, {what}: {found} of {stated}");
        }
    }
}

/// Normal numbers of a small generator: the sum of twelve uniform ones less six.
struct Dice(u64);

impl Dice {
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn readings_beyond_the_dead_centre_give_the_straight_shape() {
    let rig = rig();
    let mut beyond = values(&rig, "gecko");
    beyond[0] += f64::to_radians(1.0);
    let shape = rig.trunk.as_ref().expect("a trunk").shape(&beyond);
    assert!((shape.0[4] - PI).abs() < 1e-6, "{shape:?}");
    let pose = rig.pose_read_at(&beyond);
    assert!(pose.covariance().iter().all(|value| value.is_finite()));
}
