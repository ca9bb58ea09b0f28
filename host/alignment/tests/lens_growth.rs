//! Lenses that are longer than at their calibration: found, and not reported where they are as calibrated or a camera was turned.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use nalgebra::{Matrix6, SMatrix, UnitQuaternion, Vector3, Vector6};
use vergence_alignment::{LensGrowth, lens_growth, pose_drift};
use vergence_vision::{
    Angle, ImageSize, KannalaBrandt, LENS_PARAMETERS, Left, Pixel, PixelPair, Point, Right, SharedCovariance,
    StereoPair, Transform,
};

const NOISE_PX: f64 = 0.1;

fn lens(growth: f64) -> KannalaBrandt {
    let size = ImageSize { width: 2080, height: 2080 };
    let k = [599.0, -31.0, 2.5, -1.1, 0.12].map(|k| k * (1.0 + growth));
    KannalaBrandt::new(k, 1.0, Pixel { u: 1039.5, v: 1039.5 }, Angle::from_deg(98.0), size).unwrap()
}

/// Axes `separation_deg` apart, outward, 145 mm from each other.
fn pose(separation_deg: f64) -> Transform<Left, Right> {
    let half = separation_deg.to_radians() / 2.0;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.0 * half);
    Transform::new(turn, Vector3::new(145.0 * half.cos(), 0.0, -145.0 * half.sin()))
}

/// Numbers by the generator of D. Knuth's MMIX.
struct Dice(u64);

impl Dice {
    /// Evenly from 0 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Standard normal, by G. Box and M. Muller, 1958.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}

/// Matches of points at 0.4 to 4 m all over the field that both share, every fifth wrong by up to 40 px.
fn matches(
    lens: &KannalaBrandt,
    pose: &Transform<Left, Right>,
    count: usize,
    dice: &mut Dice,
) -> Vec<(PixelPair, f64)> {
    let mut found = Vec::new();
    while found.len() < count {
        let range = 400.0 * 10f64.powf(dice.uniform());
        let towards = dice.vector().normalize();
        let point = Point::<Left>::from_mm(towards * range);
        let image =
            |lens: &KannalaBrandt, at: Point<Left>| lens.project_point(&at).ok().filter(|at| lens.on_sensor(*at));
        let in_right = Point::<Left>::from_mm((pose.inverse() * point).mm());
        let (Some(left), Some(right)) = (image(lens, point), image(lens, in_right)) else { continue };
        let wrong = if found.len() % 5 == 0 { 40.0 } else { 0.0 };
        let mut noisy = |at: Pixel, wrong: f64| Pixel {
            u: at.u + NOISE_PX * dice.normal() + wrong * (dice.uniform() - 0.5),
            v: at.v + NOISE_PX * dice.normal() + wrong * (dice.uniform() - 0.5),
        };
        found.push((PixelPair { left: noisy(left, 0.0), right: noisy(right, wrong) }, NOISE_PX));
    }
    found
}

fn stated() -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(1e-7, 1e-7, 1e-7, 1e-2, 1e-2, 1e-2))
}

/// What matches say of lenses that grew by `growth` and stand in `truth`, where the rig file says `pose`.
fn growth(
    growth: f64,
    [truth, pose]: [&Transform<Left, Right>; 2],
    shared: &SharedCovariance,
    seed: u64,
) -> LensGrowth {
    let calibrated = lens(0.0);
    let pair = StereoPair { left: &calibrated, right: &calibrated, left_from_right: *pose };
    let pixels = matches(&lens(growth), truth, 500, &mut Dice(seed));
    let drift = pose_drift(&pixels, &pair, &stated()).unwrap();
    lens_growth(&pixels, &pair, &drift.correction, shared).unwrap()
}

#[test]
fn lenses_that_grew_are_found() {
    for (separation, smallest) in [(0.0, 2e-3), (30.0, 1e-3), (60.0, 1e-3), (90.0, 1e-3), (120.0, 2e-3)] {
        for true_growth in [smallest, 3e-3, -3e-3] {
            let pose = pose(separation);
            let found = growth(true_growth, [&pose, &pose], &SharedCovariance::exact(), 5);
            println!(
                "{separation} degrees, {:.2} %: {:.3} ± {:.3} %",
                1e2 * true_growth,
                1e2 * found.growth,
                1e2 * found.sigma
            );
            assert!(found.is_significant(), "{separation} degrees: {found:?}");
            assert!((found.growth - true_growth).abs() < 4.0 * found.sigma, "{separation} degrees: {found:?}");
        }
    }
}

/// By chance one pair in two million looks so; of fifty, none does, whether or not a camera was turned.
#[test]
fn lenses_as_calibrated_are_not_blamed() {
    let mut squares = 0.0;
    for seed in 0..50 {
        let pose = pose(30.0 * (seed % 5) as f64);
        let turn = UnitQuaternion::from_scaled_axis(Dice(seed).vector() * 0.004 * (seed % 2) as f64);
        let turned = Transform::new(turn * pose.rotation(), pose.origin().mm());
        let found = growth(0.0, [&turned, &pose], &SharedCovariance::exact(), 100 + seed);
        assert!(!found.is_significant(), "{seed}: {found:?}");
        squares += (found.growth / found.sigma).powi(2) / 50.0;
    }
    assert!((0.5..1.7).contains(&squares), "{squares}");
}

/// What the calibration itself does not know better is no growth.
#[test]
fn lenses_that_are_as_uncertain_are_not_blamed() {
    let mut lens = SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::zeros();
    // A focal length known to 0.2 %.
    lens.fixed_view_mut::<2, 2>(0, 0).fill((599.0f64 * 2e-3).powi(2));
    let shared = SharedCovariance::exact().with_lenses([&lens, &lens]);
    let pose = pose(60.0);
    let found = growth(3e-3, [&pose, &pose], &shared, 5);
    assert!(!found.is_significant() && found.sigma > 1e-3, "{found:?}");
}

#[test]
fn few_matches_tell_no_growth() {
    let (calibrated, pose) = (lens(0.0), pose(60.0));
    let pair = StereoPair { left: &calibrated, right: &calibrated, left_from_right: pose };
    let pixels = matches(&calibrated, &pose, 29, &mut Dice(1));
    assert_eq!(lens_growth(&pixels, &pair, &Vector6::zeros(), &SharedCovariance::exact()), None);
    assert_eq!(lens_growth::<f64>(&[], &pair, &Vector6::zeros(), &SharedCovariance::exact()), None);
}
