//! What the files of a calibration state of clouds, against the truth: corners go through the command line to camera files and a rig
//! file, and points at new stage poses are measured with that file. Corners, their noise and the bench's build are simulated.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use common::built_bench::{Dice, POSES, as_built, mounted, stand};
use common::corner_files::{CORNER_PX, Lenses, calibrated, noisy, projection};
use common::rendered::{band, seeds};
use image::RgbImage;
use nalgebra::Vector3;
use vergence_pipeline::{PairPose, cloud_of_pairs};
use vergence_reproduce::own_frame;
use vergence_rig::{Rig, RigCalibration, RigPose};
use vergence_vision::{Kernel, Left, PixelPair, Point};

/// Standard deviation of matched pixels: small, so that the error of the calibration is not hidden by theirs.
const MATCH_PX: f64 = 0.03;

/// Views of each lens alone: few, so that they leave much open.
const OWN_VIEWS: usize = 10;

/// The square of a point's error in units of its stated covariance, by one file; `None` where both cameras do not see it.
fn nees(file: &Rig, read: &[f64; 2], seen: &PixelPair, truth: &Vector3<f64>) -> Option<f64> {
    over(file, file.pose_read_at(read), seen, truth)
}

fn over(file: &Rig, pose: RigPose, seen: &PixelPair, truth: &Vector3<f64>) -> Option<f64> {
    let pose = PairPose::standing(pose);
    let image = RgbImage::new(1, 1);
    let cloud = cloud_of_pairs(&[(*seen, MATCH_PX)], &image, file, &pose, Kernel::default()).expect("no axis moves");
    let found = cloud.points.first()?.point;
    let error = found.point.mm() - truth;
    Some(error.dot(&found.covariance.cholesky()?.solve(&error)))
}

/// What the lenses of a bench are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Eyes {
    /// As they are made and mounted.
    Mounted,
    /// Perfectly symmetric, with one centre: better than what is known of lenses lets expect.
    Perfect,
}

/// Means over points at unseen poses by the file as written, by one that knows of no lens, and by one without its covariance.
fn trial(seed: u64, separations: [f64; 2], eyes: Eyes) -> [f64; 3] {
    const POINTS: usize = 30;
    let mut dice = Dice::new(seed);
    let rig = as_built(&mut dice);
    let rig = if eyes == Eyes::Mounted { mounted(rig, &mut Dice::new(seed + 77_000)) } else { rig };
    let work = tempfile::tempdir().expect("a temporary folder");
    let [left, right] = [&rig.left_camera, &rig.right_camera].map(projection);
    let lenses = Lenses {
        left: &left,
        right: &right,
        reach: 1.45,
        poses: POSES,
        spread: 0.5,
        own_views: OWN_VIEWS,
        bow_mm: 0.0,
        corner_px: CORNER_PX,
    };
    let written = Rig::from_toml(&calibrated(&rig, lenses, work.path(), &mut dice)).expect("a rig");
    assert!(matches!(written.calibration, RigCalibration::Covariance(_)), "the file holds a covariance");
    let unknown = Rig { calibration: RigCalibration::Unknown, ..written.clone() };
    let turn = own_frame(&written.left_camera, &rig.left_camera);
    let mut sums = [0.0; 3];
    let mut points = 0;
    while points < POINTS {
        let share = 0.5 + 0.5 * dice.uniform();
        let wished =
            [145.0 + 50.0 * dice.uniform(), (separations[0] + share * (separations[1] - separations[0])).to_radians()];
        let (read, pose) = stand(&rig, wished, &mut dice);
        let left_from_right = pose.left_from_right;
        let middle = (Vector3::z() + left_from_right.rotation() * Vector3::z()).normalize();
        let truth = Point::<Left>::from_mm((middle + 0.4 * dice.vector()).normalize() * 350.0);
        let in_right = left_from_right.inverse() * truth;
        let (Ok(left), Ok(right)) = (rig.left_camera.project_point(&truth), rig.right_camera.project_point(&in_right))
        else {
            continue;
        };
        // In the frame of the left camera's rays.
        let truth = turn * truth.mm();
        let seen = PixelPair { left: noisy(left, MATCH_PX, &mut dice), right: noisy(right, MATCH_PX, &mut dice) };
        let Some(stated) = nees(&written, &read, &seen, &truth) else { continue };
        // Its gates may refuse what it takes for impossible; that counts as far off.
        let blind = nees(&unknown, &read, &seen, &truth).unwrap_or(100.0);
        sums[0] += stated;
        sums[1] += without_lenses(&written, &read, &seen, &truth).unwrap_or(100.0);
        sums[2] += blind;
        points += 1;
    }
    sums.map(|sum| sum / POINTS as f64)
}

/// [`nees`] with the covariance of the pose alone.
fn without_lenses(file: &Rig, read: &[f64; 2], seen: &PixelPair, truth: &Vector3<f64>) -> Option<f64> {
    let mut pose = file.pose_read_at(read);
    pose.shared = vergence_vision::SharedCovariance::exact().with_pose(&pose.covariance());
    over(file, pose, seen, truth)
}

/// Points of one seed share its calibration, so a seed counts as one draw of three squared errors.
#[test]
fn clouds_are_as_far_off_as_the_rig_file_states() {
    let seeds = seeds(6);
    println!(
        "mean NEES of 3 at 30 unseen poses, {seeds} seeds: as written; without the lenses' part; without covariance"
    );
    let modes = [("human", [0.0, 10.0]), ("herbivore", [110.0, 125.0])];
    for (eyes, (name, separations)) in
        [Eyes::Mounted, Eyes::Perfect].into_iter().flat_map(|eyes| modes.map(|mode| (eyes, mode)))
    {
        let trials: Vec<[f64; 3]> = (0..seeds).map(|seed| trial(seed, separations, eyes)).collect();
        let mean = |which: usize| trials.iter().map(|trial| trial[which]).sum::<f64>() / seeds as f64;
        let (stated, lensless, blind) = (mean(0), mean(1), mean(2));
        println!("{eyes:?} lenses, {name}: {stated:.2}; {lensless:.2}; {blind:.2}");
        // Four means are judged.
        let [low, high] = band(seeds, 3.0, 2.5);
        assert!((low..high).contains(&stated), "{eyes:?}, {name}: {stated} is not within {low} to {high}");
        assert!(blind > 2.0 * stated && blind > high, "{name}: without its covariance a file is as good: {blind}");
    }
}
