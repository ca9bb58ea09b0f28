//! How far points are off that a rig file gives of matches through true lenses, and how far it states them to be.

use image::RgbImage;
use nalgebra::Vector3;
use vergence_pipeline::{PairPose, cloud_of_pairs};
use vergence_reproduce::own_frame;
use vergence_rig::{Rig, RigPose};
use vergence_scene::Lens;
use vergence_vision::{Kernel, Left, PixelPair, Point};

use crate::common::built_bench::{Dice, stand};
use crate::common::corner_files::noisy;
use crate::common::rendered::band;

/// Standard deviation of matched pixels.
pub const MATCH_PX: f64 = 0.1;

/// What points at unseen poses show of one file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    /// Mean of the squared error in units of the stated covariance.
    pub nees: f64,
    /// Mean absolute error of the range, and what the file states it to be, in millimetres.
    pub error_mm: f64,
    pub stated_mm: f64,
}

/// A file's figures at 30 points about 350 mm away, with the axes set anywhere within `separations`, in the frame of the left camera's rays.
pub fn figures(
    [rig, file]: [&Rig; 2],
    lenses: [&dyn Lens; 2],
    separations: [f64; 2],
    match_px: f64,
    dice: &mut Dice,
) -> Figures {
    figures_by(&|read| file.pose_read_at(read), [rig, file], lenses, separations, match_px, dice)
}

/// The same where the pose comes from elsewhere: `stated` gives it by what the encoders read.
pub fn figures_by(
    stated: &dyn Fn(&[f64; 2]) -> RigPose,
    [rig, file]: [&Rig; 2],
    lenses: [&dyn Lens; 2],
    separations: [f64; 2],
    match_px: f64,
    dice: &mut Dice,
) -> Figures {
    const POINTS: usize = 30;
    let mut sums = Figures::default();
    let mut points = 0;
    let turn = own_frame(&file.left_camera, lenses[0]);
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
        let seen = PixelPair { left: noisy(left, match_px, dice), right: noisy(right, match_px, dice) };
        let pose = PairPose::standing(stated(&read));
        let cloud = cloud_of_pairs(&[(seen, MATCH_PX)], &RgbImage::new(1, 1), file, &pose, Kernel::default());
        let Some(found) = cloud.expect("no axis moves").points.first().map(|found| found.point) else { continue };
        let error = found.point.mm() - turn * truth.mm();
        sums.nees += error.dot(&found.covariance.cholesky().expect("a covariance").solve(&error));
        sums.error_mm += (found.point.mm().norm() - 350.0).abs();
        sums.stated_mm += found.sigma_range.mm() * (2.0 / std::f64::consts::PI).sqrt();
        points += 1;
    }
    let mean = |sum: f64| sum / POINTS as f64;
    Figures { nees: mean(sums.nees), error_mm: mean(sums.error_mm), stated_mm: mean(sums.stated_mm) }
}

/// Separations at which clouds are made, in degrees.
pub const MODES: [(&str, [f64; 2]); 3] =
    [("human", [0.0, 10.0]), ("50 to 90 degrees", [50.0, 90.0]), ("herbivore", [110.0, 125.0])];

/// Whether a file's points are as far off as it states, with their NEES within these bounds.
pub fn is_honest(lens: &str, found: &[Figures; 3], [low, high]: [f64; 2]) {
    for ((mode, _), ours) in MODES.iter().zip(found) {
        assert!((low..high).contains(&ours.nees), "{lens}, {mode}: {} is not within {low} to {high}", ours.nees);
        // Errors scatter as the root of the squares do.
        let most = 1.15 * (high / 3.0).sqrt() * ours.stated_mm;
        assert!(ours.error_mm < most, "{lens}, {mode}: {} mm, stated {}", ours.error_mm, ours.stated_mm);
    }
}

/// The mean over `trials` of each model's figures in each mode, printed.
pub fn means<const N: usize>(models: [&str; N], trials: &[[[Figures; 3]; N]]) -> [[Figures; 3]; N] {
    let mean = |model: usize, mode: usize| {
        let mean = |value: fn(&Figures) -> f64| {
            trials.iter().map(|trial| value(&trial[model][mode])).sum::<f64>() / trials.len() as f64
        };
        Figures { nees: mean(|f| f.nees), error_mm: mean(|f| f.error_mm), stated_mm: mean(|f| f.stated_mm) }
    };
    let found: [[Figures; 3]; N] = std::array::from_fn(|model| std::array::from_fn(|mode| mean(model, mode)));
    for (index, (model, of_model)) in models.iter().zip(&found).enumerate() {
        let of_seed = |trial: &[[Figures; 3]; N]| trial[index].iter().map(|mode| mode.nees).sum::<f64>() / 3.0;
        let by_seed: Vec<_> = trials.iter().map(|trial| format!("{:.1}", of_seed(trial))).collect();
        println!("  {model}, NEES over the modes by seed: {}", by_seed.join(" "));
        for ((mode, _), found) in MODES.iter().zip(of_model) {
            let Figures { nees, error_mm, stated_mm } = found;
            println!("  {model}, {mode}: {nees:.2}, {error_mm:.3} ({stated_mm:.3})");
        }
    }
    found
}

/// Bounds of the NEES of 3 of so many benches: those of one share its calibration, and count as one draw.
pub fn bounds(trials: u64) -> [f64; 2] {
    band(trials, 3.0, 1.96)
}
