//! A rig whose lenses are traced through a published design, calibrated by the command line, and clouds by the file written: with the pupil
//! that the calibration finds, and with a central lens. Corners and matches are projected through the traced lens with Gaussian noise; the
//! bench's build is simulated.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use common::built_bench::{Dice, POSES, as_built, stand};
use common::corner_files::{Lenses, calibrated_as, noisy};
use common::rendered::{band, seeds};
use image::RgbImage;
use nalgebra::Vector3;
use vergence_pipeline::{PairPose, cloud_of_pairs};
use vergence_rig::Rig;
use vergence_scene::{Lens, LensChoice};
use vergence_vision::{Kernel, Left, Pixel, PixelPair, Point};

/// Standard deviation of matched pixels.
const MATCH_PX: f64 = 0.1;

/// What points at unseen poses show of one file.
#[derive(Clone, Copy, Default)]
struct Figures {
    /// Mean of the squared error in units of the stated covariance.
    nees: f64,
    /// Mean absolute error of the range, and what the file states it to be, in millimetres.
    error_mm: f64,
    stated_mm: f64,
}

/// A file's figures at 30 points about 350 mm away, with the axes set anywhere within `separations`.
fn figures(rig: &Rig, file: &Rig, lenses: [&dyn Lens; 2], separations: [f64; 2], dice: &mut Dice) -> Figures {
    const POINTS: usize = 30;
    let mut sums = Figures::default();
    let mut points = 0;
    while points < POINTS {
        let share = 0.5 + 0.5 * dice.uniform();
        let wished =
            [145.0 + 50.0 * dice.uniform(), (separations[0] + share * (separations[1] - separations[0])).to_radians()];
        let (read, pose) = stand(rig, wished, dice);
        let left_from_right = pose.left_from_right;
        let middle = (Vector3::z() + left_from_right.rotation() * Vector3::z()).normalize();
        let truth = Point::<Left>::from_mm((middle + 0.4 * dice.vector()).normalize() * 350.0);
        let in_right = (left_from_right.inverse() * truth).mm();
        let image = |lens: &dyn Lens, at: Vector3<f64>| lens.image_of(&Point::from_mm(at));
        let (Some(left), Some(right)) = (image(lenses[0], truth.mm()), image(lenses[1], in_right)) else { continue };
        let seen = PixelPair { left: noisy(left, MATCH_PX, dice), right: noisy(right, MATCH_PX, dice) };
        let pose = PairPose::standing(file.pose_read_at(&read));
        let cloud = cloud_of_pairs(&[(seen, MATCH_PX)], &RgbImage::new(1, 1), file, &pose, Kernel::default());
        let Some(found) = cloud.expect("no axis moves").points.first().map(|found| found.point) else { continue };
        let error = found.point.mm() - truth.mm();
        sums.nees += error.dot(&found.covariance.cholesky().expect("a covariance").solve(&error));
        sums.error_mm += (found.point.mm().norm() - 350.0).abs();
        sums.stated_mm += found.sigma_range.mm() * (2.0 / std::f64::consts::PI).sqrt();
        points += 1;
    }
    let mean = |sum: f64| sum / POINTS as f64;
    Figures { nees: mean(sums.nees), error_mm: mean(sums.error_mm), stated_mm: mean(sums.stated_mm) }
}

/// By the files that the pupil and one centre give: human, in between, herbivore.
fn trial(seed: u64, choice: LensChoice) -> [[Figures; 3]; 2] {
    let mut dice = Dice::new(seed);
    let rig = as_built(&mut dice);
    let [left, right] = [&rig.left_camera, &rig.right_camera].map(|ideal| choice.in_place_of(ideal).expect("a lens"));
    let through = |lens: &dyn Lens, at: &Vector3<f64>| -> Option<Pixel> {
        lens.image_of(&Point::from_mm(*at)).filter(|at| lens.size().contains(*at))
    };
    let (left_lens, right_lens) = (|at: &Vector3<f64>| through(&left, at), |at: &Vector3<f64>| through(&right, at));
    let lenses = Lenses { left: &left_lens, right: &right_lens, reach: 1.45, poses: POSES, spread: 0.5 };
    ["by-evidence", "central"].map(|model| {
        let mut dice = Dice::new(seed + 1000);
        let work = tempfile::tempdir().expect("a temporary folder");
        let text = calibrated_as(&rig, lenses, work.path(), &["--lens-model", model], &mut dice);
        let written = Rig::from_toml(&text).expect("a rig");
        let of = |separations| figures(&rig, &written, [&left, &right], separations, &mut Dice::new(seed + 2000));
        [of([0.0, 10.0]), of([50.0, 90.0]), of([110.0, 125.0])]
    })
}

fn mean(trials: &[[[Figures; 3]; 2]], model: usize, mode: usize) -> Figures {
    let mean = |value: fn(&Figures) -> f64| {
        trials.iter().map(|trial| value(&trial[model][mode])).sum::<f64>() / trials.len() as f64
    };
    Figures { nees: mean(|f| f.nees), error_mm: mean(|f| f.error_mm), stated_mm: mean(|f| f.stated_mm) }
}

/// Points of one seed share its calibration, so a seed counts as one draw of three squared errors.
fn check(lens: &str) {
    let seeds = seeds(3);
    let choice: LensChoice = lens.parse().expect("a lens");
    let trials: Vec<_> = (0..seeds).map(|seed| trial(seed, choice)).collect();
    let modes = ["human", "50 to 90 degrees", "herbivore"];
    let found = |mode: usize| [0, 1].map(|model| mean(&trials, model, mode));
    println!("{lens}, {seeds} seeds, points at 350 mm: NEES of 3, mean range error (stated) in mm; by one centre");
    for (mode, words) in modes.iter().enumerate() {
        let [ours, central] = found(mode);
        println!(
            "  {words}: {:.2}, {:.3} ({:.3}); {:.1}, {:.3} ({:.3})",
            ours.nees, ours.error_mm, ours.stated_mm, central.nees, central.error_mm, central.stated_mm
        );
    }
    let [low, high] = band(seeds, 3.0, 1.96);
    for (mode, words) in modes.iter().enumerate() {
        let [ours, central] = found(mode);
        assert!((low..high).contains(&ours.nees), "{lens}, {words}: {} is not within {low} to {high}", ours.nees);
        // Errors scatter as the root of the squares do.
        let most = 1.15 * (high / 3.0).sqrt() * ours.stated_mm;
        assert!(ours.error_mm < most, "{lens}, {words}: {} mm, stated {}", ours.error_mm, ours.stated_mm);
        assert!(central.nees > 1.5 * high, "{lens}, {words}: one centre is as good: {}", central.nees);
    }
}

#[test]
fn clouds_through_a_sigma_lens_are_as_far_off_as_the_rig_file_states() {
    check("sigma8_f18");
}

/// The one whose pupil moves most.
#[test]
fn clouds_through_a_nikkor_lens_are_as_far_off_as_the_rig_file_states() {
    check("nikkor6_f28");
}
