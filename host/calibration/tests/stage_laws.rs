//! Laws of the stage: exact data, what is unobservable and how it is named, the rig it makes, and refusals.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use proptest::prelude::*;
use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, apart};
use vergence_calibration::{LensKnowledge, StageCalibration, StageError, StageOptions, StagePose, calibrate_stage};
use vergence_rig::{AxisPosition, Provenance, Rig, RigAxis};
use vergence_vision::{Angle, CENTRAL_PARAMETERS, LENS_PARAMETERS, Length};

const DEG: f64 = std::f64::consts::PI / 180.0;

fn poses(bench: &Bench, at: &[[f64; 2]], noise_px: f64, dice: &mut Dice) -> Vec<StagePose> {
    at.iter().map(|&at| bench.pose(at, 4, noise_px, dice)).collect()
}

/// Readings to the last digit, where the encoder's step shall play no part.
fn exactly(readings: &[f64; 2]) -> Vec<AxisPosition> {
    vec![AxisPosition::Linear(Length::from_mm(readings[0])), AxisPosition::Rotary(Angle::from_rad(readings[1]))]
}

fn calibrated(
    bench: &Bench,
    at: &[[f64; 2]],
    noise_px: f64,
    options: &StageOptions,
) -> Result<StageCalibration, StageError> {
    calibrate_stage(&bench.drawn, &poses(bench, at, noise_px, &mut Dice::new(99)), options)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Without noise and without prior knowledge the mechanism is found as it was built, encoder scales included.
    #[test]
    fn exact_corners_give_the_exact_mechanism(seed in 0u64..10_000) {
        let mut dice = Dice::new(seed);
        let bench = Bench { steps: false, ..Bench::built(&mut dice) };
        let poses = poses(&bench, &SIX_POSES, 0.0, &mut dice);
        let options = StageOptions { tolerance: None, ..StageOptions::default() };
        let stage = calibrate_stage(&bench.drawn, &poses, &options).unwrap();
        for _ in 0..10 {
            let at = bench.anywhere(&mut dice);
            let (rotation, translation) = apart(&stage.predict(&exactly(&at)).left_from_right, &bench.left_from_right(&at));
            prop_assert!(rotation < 1e-5 && translation < 1e-4, "{rotation}° {translation} mm");
        }
        prop_assert!(stage.scales.iter().zip(bench.scales).all(|(found, true_)| (found.scale - true_).abs() < 1e-6));
    }
}

/// The rig made of the calibration says the same as the calibration.
/// The solver differentiates the mechanism in closed form, a rig by differences of its own kinematics.
#[test]
fn the_written_file_states_the_covariance_of_the_calibration() {
    let mut dice = Dice::new(8);
    let bench = Bench::built(&mut dice);
    let options = StageOptions { lenses: LensKnowledge::Free, ..StageOptions::default() };
    let stage = calibrated(&bench, &SIX_POSES, 0.1, &options).unwrap();
    let provenance = Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let written = stage.rig(&bench.drawn).to_toml(&provenance).unwrap();
    let read = Rig::from_toml(&written).unwrap();
    for _ in 0..20 {
        let at = bench.anywhere(&mut dice);
        let (stated, found) = (stage.shared(&exactly(&at)), read.pose_read_at(&at).shared);
        let sigma = stated.matrix().diagonal().map(f64::sqrt);
        // The pupils of central lenses do not move, and symmetric lenses have no asymmetry.
        let known = sigma.iter().enumerate().filter(|(_, sigma)| **sigma == 0.0).map(|(parameter, _)| parameter);
        let absent = |first: usize| first + CENTRAL_PARAMETERS..first + LENS_PARAMETERS;
        assert!(known.eq(absent(0).chain(absent(LENS_PARAMETERS))));
        let sigma = sigma.map(|sigma| if sigma > 0.0 { sigma } else { 1.0 });
        // As correlations: pixels, radians and millimetres differ by orders of magnitude.
        let apart = (stated.matrix() - found.matrix()).component_div(&(sigma * sigma.transpose())).amax();
        assert!(apart < 1e-6, "{apart}");
    }
}

#[test]
fn the_rig_predicts_what_the_calibration_predicts() {
    let mut dice = Dice::new(5);
    let bench = Bench::built(&mut dice);
    let stage = calibrated(&bench, &SIX_POSES, 0.1, &StageOptions::default()).unwrap();
    let rig = stage.rig(&bench.drawn);
    for _ in 0..20 {
        let at = bench.anywhere(&mut dice);
        let (rotation, translation) =
            apart(&rig.pose_at_values(&at).left_from_right, &stage.predict(&exactly(&at)).left_from_right);
        assert!(rotation < 1e-6 && translation < 1e-9);
    }
    let (rotation, translation) = stage.largest_sigma();
    assert!(rotation.deg() < 0.02 && translation.mm() < 0.2);
    assert!(rotation.deg() > 1e-4 && translation.mm() > 1e-3);
    // The file remembers between which readings the rig was calibrated.
    for (index, axis) in rig.axes.iter().enumerate() {
        let at = SIX_POSES.map(|pose| pose[index]);
        let ends = axis.calibrated.unwrap().map(|end| end.value());
        let [low, high] = [at.into_iter().fold(f64::INFINITY, f64::min), at.into_iter().fold(0.0, f64::max)];
        assert!((ends[0] - low).abs() < 0.05 && (ends[1] - high).abs() < 0.05, "{ends:?}");
    }
    let axes: Vec<_> = rig.axes.into_iter().map(|axis| RigAxis { calibrated: None, ..axis }).collect();
    assert_eq!((rig.name, rig.modes, axes), (bench.drawn.name, bench.drawn.modes, bench.drawn.axes));
}

/// The zero offsets and scales that the bench was built with are found within their uncertainty.
#[test]
fn scales_lie_within_their_uncertainty() {
    for seed in 0..4 {
        let bench = Bench::built(&mut Dice::new(seed));
        let stage = calibrated(&bench, &SIX_POSES, 0.1, &StageOptions::default()).unwrap();
        for (found, built) in stage.scales.iter().zip(bench.scales) {
            assert!((found.scale - built).abs() < 4.0 * found.sigma, "{found:?} {built}");
            assert!(found.sigma < 1e-3);
        }
        assert_eq!(stage.zero_offsets.len(), 2);
        assert!(stage.observability.weak.is_empty(), "{}", stage.observability);
    }
}

/// Moved by hand: an encoder whose index lies 1.5 mm and 0.4° off shows in the zero offsets, and only there.
#[test]
fn a_shifted_encoder_zero_shows_as_a_zero_offset() {
    let bench = Bench::built(&mut Dice::new(8));
    let mut poses = poses(&bench, &SIX_POSES, 0.1, &mut Dice::new(9));
    let as_is = calibrate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    for pose in &mut poses {
        let [x, theta] = [pose.readings[0].value() - 1.5, pose.readings[1].value() - 0.4 * DEG];
        pose.readings = exactly(&[x, theta]);
    }
    let shifted = calibrate_stage(&bench.drawn, &poses, &StageOptions::default()).unwrap();
    let change = |axis: usize| shifted.zero_offsets[axis].offset.value() - as_is.zero_offsets[axis].offset.value();
    // The scales are a few parts in a thousand off one, the screws a degree off the drawing.
    assert!((change(0) - 1.5).abs() < 0.1, "{}", change(0));
    assert!((change(1) / DEG - 0.4).abs() < 0.01, "{}", change(1) / DEG);
    assert!((shifted.rms_inlier_px - as_is.rms_inlier_px).abs() < 1e-3);
}

#[test]
fn a_separation_that_never_moved_is_named() {
    let bench = Bench::built(&mut Dice::new(1));
    let at = [[60.0, 0.5], [140.0, 0.5], [220.0, 0.5]];
    let stage = calibrated(&bench, &at, 0.1, &StageOptions::default()).unwrap();
    assert_eq!(stage.observability.never_moved, ["separation"]);
    let text = stage.observability.to_string();
    println!("{text}");
    assert!(text.contains("'separation' never moved: add a pose with another separation"));
    assert!(text.contains("'separation' axis"));
    // The advice is a separation far from the one there is.
    assert!((stage.observability.next_pose[1].value() - 0.5).abs() > 0.4);

    // Without a drawing to hold what is open there is no calibration, and the reason says the same.
    let alone = StageOptions { tolerance: None, ..StageOptions::default() };
    let Err(StageError::Unobservable(observability)) = calibrated(&bench, &at, 0.1, &alone) else {
        panic!("a turn that never turned cannot be calibrated");
    };
    assert_eq!(observability.never_moved, ["separation"]);
    assert!(observability.weak.len() >= 4);
}

/// Where both cameras turn, three poses leave two combinations to the drawing, one if the scales are known; the advised
/// poses settle them.
#[test]
fn the_advised_poses_make_everything_observable() {
    let bench = Bench::built(&mut Dice::new(2));
    let mut at = vec![[60.0, 0.0], [220.0, 60.0 * DEG], [140.0, 130.0 * DEG]];
    let weak = |at: &[[f64; 2]], options: &StageOptions| calibrated(&bench, at, 0.1, options).unwrap().observability;
    let known_scales = StageOptions { free_scales: false, ..StageOptions::default() };
    assert_eq!(weak(&at, &known_scales).weak.len(), 1);
    let mut observability = weak(&at, &StageOptions::default());
    println!("{observability}");
    assert_eq!((observability.weak.len(), observability.unknowns, observability.determined), (2, 18, 16));
    while !observability.weak.is_empty() && at.len() < 6 {
        at.push([observability.next_pose[0].value(), observability.next_pose[1].value()]);
        observability = weak(&at, &StageOptions::default());
        println!("{observability}");
    }
    assert!(at.len() <= 5, "two more poses must do");
}

/// Slide and one turn, nothing known but the structure: 14 unknowns, and these three poses determine all of them.
#[test]
fn three_poses_suffice_where_one_camera_turns() {
    let bench = Bench::built(&mut Dice::new(4)).with_the_left_camera_fixed();
    let at = [[60.0, 0.0], [200.0, 0.0], [60.0, 100.0 * DEG]];
    let options = StageOptions { tolerance: None, ..StageOptions::default() };
    let stage = calibrated(&bench, &at, 0.1, &options).unwrap();
    println!("{}", stage.observability);
    assert_eq!((stage.observability.unknowns, stage.observability.determined), (14, 14));
    let (rotation, translation) =
        apart(&stage.predict(&exactly(&[145.0, 0.9])).left_from_right, &bench.left_from_right(&[145.0, 0.9]));
    assert!(rotation < 0.03 && translation < 0.2, "{rotation}° {translation} mm");
}

#[test]
fn refusals_are_named() {
    let bench = Bench::built(&mut Dice::new(3));
    let mut poses = poses(&bench, &SIX_POSES[..3], 0.1, &mut Dice::new(4));
    let calibrate = |poses: &[StagePose], options: &StageOptions| calibrate_stage(&bench.drawn, poses, options).err();
    let usual = StageOptions::default();
    assert_eq!(calibrate(&poses[..2], &usual), Some(StageError::TooFewPoses(2)));
    let none = StageOptions { reading_sigma: exactly(&[0.0, 1e-5]), ..usual.clone() };
    assert_eq!(calibrate(&poses, &none), Some(StageError::ReadingSigma));
    poses[1].readings.reverse();
    assert_eq!(calibrate(&poses, &usual), Some(StageError::Readings { pose: 2 }));
    poses[1].readings.reverse();
    poses[2].views.truncate(1);
    assert!(matches!(calibrate(&poses, &usual), Some(StageError::Pose { pose: 3, .. })));
}
