//! Printing of rig files, and reading them back.
#![allow(clippy::expect_used, clippy::unwrap_used, reason = "a test fails loudly")]

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_rig::{
    AxisPosition, BENCH_TOML, CameraMask, Chain, Link, Provenance, Rig, RigCalibration, Screw, Shutter,
};
use vergence_vision::{Angle, Length, Point, Transform};

fn provenance() -> Provenance {
    Provenance { program: "vergence 0.1.0".into(), inputs_sha256: "00".repeat(32), date: Some("2026-11-21".into()) }
}

fn read_back(rig: &Rig) -> Rig {
    Rig::from_toml(&rig.to_toml(&provenance()).expect("TOML")).expect("a rig")
}

#[test]
fn the_bench_comes_back_as_it_was() {
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
    let read = read_back(&bench);
    assert_eq!(read.axes, bench.axes);
    assert_eq!(read.modes, bench.modes);
    assert_eq!(read.calibration, bench.calibration);
    assert!((read.left_camera.theta_max().rad() - bench.left_camera.theta_max().rad()).abs() < 1e-15);
    // The file is readable for people.
    let text = bench.to_toml(&provenance()).expect("TOML");
    assert!(text.contains("separation = \"120.0deg\"") && text.contains("date = \"2026-11-21\""), "{text}");
}

/// The bench with `keys` in front of one of its own.
fn with(keys: &str, before: &str) -> Result<Rig, vergence_rig::RigError> {
    Rig::from_toml(&BENCH_TOML.replacen(before, &format!("{keys}\n{before}"), 1))
}

#[test]
fn a_rolling_shutter_comes_back_as_it_was() {
    let rig = with("line_time = \"-14.8us\"", "theta_max").expect("a rig");
    let rolling = Shutter::Rolling { line_us: -14.8 };
    assert_eq!(rig.shutters, [rolling, Shutter::Global]);
    assert_eq!(read_back(&rig).shutters, rig.shutters);
    assert_eq!(rolling.span(1280).as_micros(), 18_929);
    let wrong = with("line_time = \"14.8\"", "theta_max").expect_err("it has no unit");
    assert!(wrong.to_string().contains("15us"), "{wrong}");
}

#[test]
fn masks_come_back_as_they_were() {
    let shape = |side: &str| format!("[[{side}.mask]]\nhides = \"outside\"\ncircle = [639.5, 639.5, 620.0]\n");
    let polygon = "[[left.mask]]\nhides = \"inside\"\npolygon = [[500, 1279], [560, 1100], [720, 1100.5]]\n";
    let file = "[right]\nmask = \"masks/right.png\"\n";
    let rig = with(&[&shape("left"), polygon, file].concat(), "[left.camera]").expect("a rig");
    assert!(matches!(&rig.masks[0], Some(CameraMask::Shapes(shapes)) if shapes.len() == 2), "{:?}", rig.masks);
    assert_eq!(rig.masks[1].as_ref().and_then(CameraMask::file), Some("masks/right.png".as_ref()));
    assert_eq!(read_back(&rig).masks, rig.masks);
    let from_folder = rig.with_masks_from("/rigs".as_ref());
    assert_eq!(from_folder.masks[1].as_ref().and_then(CameraMask::file), Some("/rigs/masks/right.png".as_ref()));
    let wrong = with(&shape("right").replace("620.0", "2000"), "[left.camera]").expect_err("it hides nothing");
    assert!(wrong.to_string().contains("[[right.mask]]: shape 1: it hides no pixel"), "{wrong}");
}

#[test]
fn a_pose_beyond_the_calibrated_range_gives_a_warning() {
    let rig = with("calibrated = [\"80mm\", \"200mm\"]", "counts_per_metre").expect("a rig");
    assert_eq!(read_back(&rig).axes, rig.axes);
    let warning_at = |mm: f64| rig.axes[0].extrapolation(AxisPosition::Linear(Length::from_mm(mm)));
    assert_eq!([80.0, 140.0, 200.3].map(warning_at), [None, None, None]);
    let warning = warning_at(215.0).expect("it lies beyond");
    assert!(warning.starts_with("baseline 215.0 mm lies outside 80.0 mm to 200.0 mm"), "{warning}");
    // The file states no calibrated range of the other axis.
    assert_eq!(rig.axes[1].extrapolation(AxisPosition::Rotary(Angle::from_deg(129.0))), None);
    assert!(with("calibrated = [\"200mm\", \"80mm\"]", "counts_per_metre").is_err());
}

fn vector(bound: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-bound..bound).prop_map(Vector3::from)
}

proptest! {
    /// Any result of a calibration survives printing and parsing.
    #[test]
    fn any_mechanism_comes_back(
        about in vector(1.0), along in vector(1.0), through in vector(300.0), shift in vector(300.0),
        turn in vector(1.7), share in -2.0..2.0_f64, baseline in 60.0..220.0_f64, separation in 0.0..2.2_f64,
    ) {
        prop_assume!(about.norm() > 0.1 && along.norm() > 0.1);
        let mut rig = Rig::from_toml(BENCH_TOML).unwrap();
        let screws = [
            (0, Screw::Slide { along: Unit::new_normalize(along) }),
            (1, Screw::Turn { about: Unit::new_normalize(about), through: Point::from_mm(through) }),
        ];
        let links = screws.map(|(axis, screw)| Link { axis, share, screw }).to_vec();
        let at_zero = Isometry3::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(turn));
        rig.right_chain = Chain::new(links, Transform::from_isometry(at_zero));
        rig.calibration = RigCalibration::Sigmas {
            rotation: Angle::from_rad(separation * 1e-4),
            translation: Length::from_mm(share.abs()),
        };
        rig.modes[0].targets = vec![
            AxisPosition::Linear(Length::from_mm(baseline)),
            AxisPosition::Rotary(Angle::from_rad(separation)),
        ];
        let read = read_back(&rig);
        prop_assert_eq!(&read.modes, &rig.modes);
        let sigma = |rig: &Rig| match rig.calibration {
            RigCalibration::Sigmas { rotation, .. } => rotation.rad(),
            _ => f64::NAN,
        };
        prop_assert!((sigma(&read) - sigma(&rig)).abs() < 1e-15);
        let values = [baseline, separation];
        let [before, after] = [&rig, &read].map(|rig| rig.pose_at_values(&values).left_from_right);
        prop_assert!((before.origin().mm() - after.origin().mm()).norm() < 1e-9);
        prop_assert!(before.rotation().angle_to(&after.rotation()) < 1e-9);
    }
}

#[test]
fn a_fixed_pair_is_a_rig_without_axes() {
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.01, 2.0, -0.005));
    let left_from_right: Transform<vergence_vision::Left, vergence_vision::Right> =
        Transform::new(rotation, Vector3::new(140.0, 3.0, -12.0));
    let calibration = RigCalibration::Sigmas { rotation: Angle::from_deg(0.05), translation: Length::from_mm(0.2) };
    let lenses = (bench.left_camera, bench.right_camera);
    let pair = Rig { calibration, ..Rig::fixed_pair("pair", lenses, left_from_right) };
    let pose = read_back(&pair).pose_at_values(&[]);
    assert!((pose.left_from_right.origin().mm() - Vector3::new(140.0, 3.0, -12.0)).norm() < 1e-12);
    assert!(pose.left_from_right.rotation().angle_to(&rotation) < 1e-12);
    assert!((pose.rotation_sigma.deg() - 0.05).abs() < 1e-12);
}
