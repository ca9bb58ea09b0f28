//! A lens whose radius has terms beyond θ⁹: the vectors and laws of its projection, one by one and in batches.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::Vector3;
use proptest::prelude::*;
use vergence_vision::{
    Angle, Asymmetry, BatchLens, BatchPair, Camera, ImageSize, Instructions, InvalidLens, KannalaBrandt,
    LENS_PARAMETERS, Left, Length, OpenCvFisheye, Pixel, Point, PointUncertainty, Pupil, Right, SharedCovariance,
    StereoPair, Transform, UnitRay, pseudo_intersection,
};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
const FIELD: Angle = Angle::from_deg(105.0);
const OPENCV: OpenCvFisheye =
    OpenCvFisheye { fx: 599.1, fy: 606.0, cx: 1020.0, cy: 1031.0, k: [-0.052, 0.0041, -0.0019, 0.0002] };
const FURTHER: [f64; 2] = [4e-5, -3e-6];

fn lens(e0: f64) -> KannalaBrandt {
    let symmetric = KannalaBrandt::from_opencv_with(OPENCV, FURTHER, FIELD, SIZE).unwrap();
    symmetric.with_pupil(Pupil::from_mm([e0, 0.1 * e0])).unwrap()
}

fn ray(theta: f64, phi: f64) -> UnitRay<Camera> {
    let across = theta.sin();
    UnitRay::new(Vector3::new(across * phi.cos(), across * phi.sin(), theta.cos())).unwrap()
}

fn apart(a: Pixel, b: Pixel) -> f64 {
    (a.u - b.u).hypot(a.v - b.v)
}

/// FISHEYE624 of Project Aria has six radial coefficients too: vectors of the design notes, made by other code.
#[test]
fn a_symmetric_radius_of_six_terms_is_that_of_fisheye624() {
    let opencv = OpenCvFisheye { fx: 600.0, fy: 600.0, cx: 1024.0, cy: 1022.0, k: [-0.02, 0.003, -0.001, 0.0002] };
    let lens = KannalaBrandt::from_opencv_with(opencv, [-1e-5, 1e-6], FIELD, SIZE).unwrap();
    let asymmetry = Asymmetry { tangential: [1e-3, -5e-4], prism: [2e-4, -1e-4, 3e-4, 5e-5], growth: [0.0; 2] };
    let lens = lens.with_asymmetry(asymmetry).unwrap();
    for (at, u, v) in
        [([0.3, -0.2, 0.9], 1213.947358211, 895.420190998), ([-0.7, 0.4, -0.1], 184.906396393, 1502.216843003)]
    {
        let pixel = lens.project(&UnitRay::<Camera>::new(at.into()).unwrap()).unwrap();
        assert!(apart(pixel, Pixel { u, v }) < 1e-8, "{pixel:?}");
    }
}

#[test]
fn terms_of_zero_are_the_lens_without_them() {
    let without = KannalaBrandt::from_opencv(OPENCV, FIELD, SIZE).unwrap();
    assert_eq!(without.with_further_terms([0.0; 2]), Ok(without));
    assert_eq!(lens(0.0).with_further_terms([0.0; 2]), Ok(without));
    assert_eq!(without.with_further_terms(FURTHER), Ok(lens(0.0)));
    assert!(without.fits_opencv() && !lens(0.0).fits_opencv());
    let batch = [without, lens(0.0).with_further_terms([0.0; 2]).unwrap()].map(|lens| BatchLens::new(&lens));
    assert_eq!(batch[0], batch[1]);
}

/// The radius counts as a whole: its first five terms alone may turn over where it does not, and it where they do not.
#[test]
fn only_a_radius_that_grows_makes_a_lens() {
    let turning = OpenCvFisheye { k: [0.02, 0.0, 0.0, -0.002], ..OPENCV };
    let alone = KannalaBrandt::from_opencv(turning, FIELD, SIZE);
    assert!(matches!(alone, Err(InvalidLens::TurnsOver { .. })), "{alone:?}");
    let whole = KannalaBrandt::from_opencv_with(turning, [6e-4, 0.0], FIELD, SIZE).unwrap();
    assert!(matches!(whole.with_further_terms([0.0; 2]), Err(InvalidLens::TurnsOver { .. })));
    assert!(matches!(lens(0.0).with_further_terms([0.0, -1e-4]), Err(InvalidLens::TurnsOver { .. })));
    assert_eq!(lens(0.0).with_further_terms([f64::NAN, 0.0]), Err(InvalidLens::NotFinite));
    // What stands in for it has a radius that grows, too.
    let nearest = KannalaBrandt::from_opencv(whole.nearest_opencv(), FIELD, SIZE).unwrap();
    assert!(whole.largest_difference(&nearest, Length::from_mm(1e6)) < 1.0);
}

#[test]
fn a_wider_or_coarser_lens_keeps_its_terms() {
    let lens = lens(2.8);
    let half = lens.resampled(1024).unwrap();
    assert_eq!((half.further_terms(), half.pupil()), (FURTHER, lens.pupil()));
    let (whole, half) = (lens.project(&ray(1.6, 0.7)).unwrap(), half.project(&ray(1.6, 0.7)).unwrap());
    assert!(apart(Pixel { u: (whole.u + 0.5) / 2.0 - 0.5, v: (whole.v + 0.5) / 2.0 - 0.5 }, half) < 1e-9);
    let narrow = KannalaBrandt::from_opencv_with(OPENCV, FURTHER, Angle::from_deg(50.0), SIZE).unwrap();
    let wide = narrow.extrapolated();
    let largest = OPENCV.largest_theta_with(FURTHER, SIZE).unwrap();
    assert_eq!((wide.further_terms(), wide.theta_max()), (FURTHER, largest));
}

/// For programs that know of four coefficients: nearer than the four of this lens are.
#[test]
fn a_lens_of_four_terms_stands_in() {
    let lens = lens(0.0);
    let stand_in = KannalaBrandt::from_opencv(lens.nearest_opencv(), FIELD, SIZE).unwrap();
    let cut = KannalaBrandt::from_opencv(OPENCV, FIELD, SIZE).unwrap();
    let off = |other: &KannalaBrandt| lens.largest_difference(other, Length::from_mm(500.0));
    assert!(off(&stand_in) < 0.02 * off(&cut), "{} and {} px", off(&stand_in), off(&cut));
    assert_eq!(cut.nearest_opencv(), OPENCV);
}

proptest! {
    #[test]
    fn pixel_and_ray_return_to_each_other(theta in 0.0..1.83f64, phi in -3.2..3.2f64) {
        let (lens, ray) = (lens(0.0), ray(theta, phi));
        let pixel = lens.project(&ray).unwrap();
        let back = lens.unproject::<Camera>(pixel).unwrap();
        prop_assert!((back.vector() - ray.vector()).norm() < 1e-14);
        prop_assert!(apart(lens.project(&back).unwrap(), pixel) < 1e-9);
    }

    #[test]
    fn derivatives_agree_with_differences(theta in 0.0..1.8f64, phi in -3.2..3.2f64) {
        let (lens, ray) = (lens(0.0), ray(theta, phi));
        let by_lens = lens.pixel_by_lens(&ray);
        for (index, step) in [(0, 1e-6), (1, 1e-6)] {
            let seen = |sign: f64| {
                let mut further = FURTHER;
                further[index] += sign * step;
                lens.with_further_terms(further).unwrap().project(&ray).unwrap()
            };
            let (above, below) = (seen(1.0), seen(-1.0));
            for (row, change) in [above.u - below.u, above.v - below.v].into_iter().enumerate() {
                let expected = change / (2.0 * step);
                prop_assert!((by_lens[(row, 16 + index)] - expected).abs() < 1e-6 * expected.abs().max(100.0));
            }
        }
        let slope = lens.pixels_per_radian(Angle::from_rad(theta));
        let radius = |theta: f64| lens.radius(Angle::from_rad(theta));
        prop_assert!((slope - (radius(theta + 1e-4) - radius(theta - 1e-4)) / 2e-4).abs() < 1e-4);
    }

    #[test]
    fn batches_give_what_single_points_give(
        theta in 0.01..1.8f64, phi in -3.2..3.2f64, range in 60.0..3000.0f64, e0 in prop_oneof![Just(0.0), 0.5..3.0f64],
    ) {
        let (lens, ray) = (lens(e0), ray(theta, phi));
        let point = ray.vector() * range;
        let (far, near) = (lens.project(&ray).unwrap(), lens.project_point(&Point::<Camera>::from_mm(point)).ok());
        for instructions in [Instructions::Best, Instructions::Baseline] {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            prop_assert!(batch.is_fitted());
            let rows = [point.into(), [0.0, 0.0, -1.0]];
            let [[u, v], [outside, _]] = batch.project(&rows)[..] else { panic!("two pixels") };
            let seen = Pixel { u, v };
            prop_assert!(apart(seen, far) < 1e-9 && outside.is_nan());
            let [u, v] = batch.project_points(&rows)[0];
            let none = Pixel { u: f64::NAN, v: f64::NAN };
            let off = apart(Pixel { u, v }, near.unwrap_or(none));
            // 9e-10 rad.
            prop_assert!(off < 6e-7 || (near.is_none() && off.is_nan()), "{off}");
            let found = batch.project_with_derivatives(&rows);
            prop_assert!(apart(found.pixel(0).unwrap(), far) < 1e-9);
            prop_assert!((found.by_point(0).unwrap() * range - lens.pixel_by_ray(&ray)).amax() < 1e-9 * 600.0);
            let by_lens = lens.pixel_by_lens(&ray);
            prop_assert!((found.by_lens(0).unwrap() - by_lens).amax() < 1e-11 * by_lens.amax());
            let [x, y, z, shift] = batch.unproject_with_shifts(&[[far.u, far.v]])[0];
            prop_assert!((Vector3::new(x, y, z) - ray.vector()).norm() < 1e-12);
            prop_assert!((shift - lens.origin_of(&ray).mm().z).abs() < 2e-9);
        }
    }

    #[test]
    fn a_pair_of_arrays_gives_what_single_points_give(theta in 0.6..1.2f64, phi in -3.1..3.1f64, range in 150.0..800.0f64) {
        let lenses = [lens(0.0), lens(0.0)];
        let left_from_right = Transform::<Left, Right>::new(Default::default(), Vector3::new(140.0, 2.0, -3.0));
        let pair = StereoPair { left: &lenses[0], right: &lenses[1], left_from_right };
        let mut covariance = nalgebra::SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::zeros();
        (covariance[(16, 16)], covariance[(17, 17)]) = (1e-10, 1e-12);
        let shared = SharedCovariance::exact().with_lenses([&covariance, &covariance]);
        let point = Point::<Left>::from_mm(ray(theta, phi).vector() * range);
        let right = (left_from_right.inverse() * point).direction().unwrap();
        let left = point.direction().unwrap();
        let made = pseudo_intersection(&left, &(left_from_right * right), &left_from_right.origin());
        let Ok(made) = made else { return Ok(()) };
        let expected = PointUncertainty::of(&made.point, &pair, 0.3).unwrap().covariance(&shared);
        let found = BatchPair::new(&pair, 0.3, &shared).triangulate(&[left.vector().into()], &[right.vector().into()]);
        prop_assert!((Vector3::from(found.points[0]) - made.point.mm()).norm() < 1e-9 * range);
        let [xx, xy, _, _, _, zz] = found.covariances[0];
        let off = [xx - expected[(0, 0)], xy - expected[(0, 1)], zz - expected[(2, 2)]];
        prop_assert!(off.iter().all(|off| off.abs() < 1e-9 * expected.trace()), "{off:?}");
        // What is not known of the terms makes the point less certain.
        let exact = PointUncertainty::of(&made.point, &pair, 0.3).unwrap().from_pixels;
        prop_assert!(expected.trace() > exact.trace());
    }
}
