//! The covariance of a calibration in the rig file: what is refused, and what poses make of it.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic, reason = "a test fails loudly")]

use vergence_rig::{BENCH_TOML, Provenance, Rig, RigCalibration};
use vergence_vision::LENS_PARAMETERS;

/// The bench without a word on its calibration.
fn silent() -> String {
    let (head, tail) = BENCH_TOML.split_once("[calibration_sigma]").unwrap();
    let (_, tail) = tail.split_once("\n\n").unwrap();
    format!("{head}{tail}")
}

fn with(table: &str) -> Result<Rig, String> {
    Rig::from_toml(&format!("{}\n{table}", silent())).map_err(|error| error.to_string())
}

const HUMAN: [f64; 2] = [145.0, 0.0];

#[test]
fn a_file_that_says_nothing_knows_nothing() {
    let rig = with("").unwrap();
    assert_eq!(rig.calibration, RigCalibration::Unknown);
    let pose = rig.pose_read_at(&HUMAN);
    assert!(!pose.is_calibration_known && pose.rotation_sigma.deg() < 0.005, "{}", pose.rotation_sigma);
    let bench = Rig::from_toml(BENCH_TOML).unwrap().pose_read_at(&HUMAN);
    assert!(bench.is_calibration_known && bench.rotation_sigma.deg() > 0.019);
}

#[test]
fn numbers_move_pose_and_lenses_by_their_units() {
    let rig = with(
        "[calibration]\nversion = 1\nnumbers = [\"right.at_zero.origin.x\", \"axis.baseline.scale\", \"left.camera.fx\"]\n\
         covariance = [[0.04], [0.0, 1e-6], [0.0, 0.0, 0.25]]\n",
    )
    .unwrap();
    let shared = rig.pose_at_values(&HUMAN).shared;
    let shift = 2 * LENS_PARAMETERS + 3;
    // 0.2 mm of the mount, and a thousandth of 145 mm.
    let expected = 0.04 + 0.145f64.powi(2);
    assert!((shared.matrix()[(shift, shift)] - expected).abs() < 1e-9, "{}", shared.matrix()[(shift, shift)]);
    assert!((shared.matrix()[(0, 0)] - 0.25).abs() < 1e-12);
    // Pixels shrink with the images.
    let half = rig.with_sensors(640).unwrap().pose_at_values(&HUMAN).shared;
    assert!((half.matrix()[(0, 0)] - 0.0625).abs() < 1e-12);
}

/// In the same way whatever is known of the calibration, also where a pose is planned.
#[test]
fn repeatability_enters_every_pose() {
    let rig = with("[repeatability]\nrotation = \"0.05deg\"\ntranslation = \"0.2mm\"\n").unwrap();
    let provenance = Provenance { program: String::new(), inputs_sha256: String::new(), date: None };
    let read_back = Rig::from_toml(&rig.to_toml(&provenance).unwrap()).unwrap();
    assert_eq!(read_back.repeatability, rig.repeatability);
    let exact = with("").unwrap();
    let turn = 0.05f64.to_radians();
    for (with, without) in [
        (rig.pose_at_values(&HUMAN), exact.pose_at_values(&HUMAN)),
        (read_back.pose_read_at(&HUMAN), exact.pose_read_at(&HUMAN)),
    ] {
        let more = with.covariance() - without.covariance();
        assert!((more[(0, 0)] - turn * turn).abs() < 1e-12 && (more[(5, 5)] - 0.04).abs() < 1e-12, "{more}");
        assert!(with.rotation_sigma.rad() >= turn && !with.is_calibration_known);
    }
}

#[test]
fn tables_that_contradict_are_refused_with_the_reason() {
    let numbers = "numbers = [\"right.at_zero.origin.x\", \"left.camera.fx\"]";
    for (table, said) in [
        (format!("[calibration]\nversion = 2\n{numbers}\ncovariance = [[1.0], [0.0, 1.0]]"), "version 2"),
        (format!("[calibration]\nversion = 1\n{numbers}\ncovariance = [[1.0], [0.0]]"), "lower triangle"),
        (format!("[calibration]\nversion = 1\n{numbers}\ncovariance = [[1.0], [1.5, 1.0]]"), "positive"),
        (format!("[calibration]\nversion = 1\n{numbers}\ncovariance = [[-1.0], [0.0, 1.0]]"), "positive"),
        ("[calibration]\nversion = 1\nnumbers = [\"left.camera.f\"]\ncovariance = [[1.0]]".into(), "left.camera.f"),
        ("[calibration]\nversion = 1\nnumbers = [\"left.screw.7.line.x\"]\ncovariance = [[1.0]]".into(), "left.screw.7"),
        (
            "[calibration]\nversion = 1\nnumbers = [\"left.camera.fx\", \"left.camera.fx\"]\ncovariance = [[1.0], [0.0, 1.0]]"
                .into(),
            "twice",
        ),
        (
            format!(
                "[calibration]\nversion = 1\n{numbers}\ncovariance = [[1.0], [0.0, 1.0]]\n\
                 [calibration_sigma]\nrotation = \"0.1deg\"\ntranslation = \"1mm\""
            ),
            "leave one of them out",
        ),
        ("[calibration_sigma]\nrotation = \"-0.1deg\"\ntranslation = \"1mm\"".into(), "negative"),
        ("[repeatability]\nrotation = \"0.1deg\"\ntranslation = \"-1mm\"".into(), "[repeatability]"),
    ] {
        let refused = with(&table).expect_err(&table);
        assert!(refused.contains(said), "{refused}");
    }
}
