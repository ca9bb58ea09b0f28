//! A lens with elements off its axis: the vectors and laws of its projection and its derivatives, one by one and in batches.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{Matrix2, Vector2, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Asymmetry, BatchLens, Camera, ImageSize, Instructions, InvalidLens, KannalaBrandt, LENS_PARAMETERS, Length,
    OpenCvFisheye, Pixel, Point, Pupil, UnitRay,
};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
const ASYMMETRY: Asymmetry =
    Asymmetry { tangential: [0.0012, -0.0007], prism: [0.0009, -0.0002, -0.0011, 0.0003], growth: [2e-4, -1e-4] };

fn central() -> KannalaBrandt {
    let opencv = OpenCvFisheye { fx: 599.1, fy: 599.1, cx: 1024.0, cy: 1024.0, k: [-0.052, 0.0041, -0.0019, 0.0002] };
    KannalaBrandt::from_opencv(opencv, Angle::from_deg(105.0), SIZE).unwrap()
}

/// With an aspect ratio too, so that no factor of it is lost.
fn of(parameters: [f64; LENS_PARAMETERS]) -> KannalaBrandt {
    let [fx, fy, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4] = parameters;
    let opencv = OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] };
    let central = KannalaBrandt::from_opencv_with(opencv, [k5, k6], Angle::from_deg(105.0), SIZE).unwrap();
    let moving = central.with_pupil(Pupil::from_mm([e0, e1])).unwrap();
    moving.with_asymmetry(Asymmetry::from_array([p1, p2, s0, s1, s2, s3, p3, p4])).unwrap()
}

const PARAMETERS: [f64; LENS_PARAMETERS] = [
    599.1, 606.0, 1020.0, 1031.0, -0.052, 0.0041, -0.0019, 0.0002, 2.77, 0.056, 0.0012, -0.0007, 0.0009, -0.0002,
    -0.0011, 0.0003, -4e-5, 3e-6, 2e-4, -1e-4,
];

fn ray(theta: f64, phi: f64) -> UnitRay<Camera> {
    let across = theta.sin();
    UnitRay::new(Vector3::new(across * phi.cos(), across * phi.sin(), theta.cos())).unwrap()
}

/// The formulas evaluated with 50 digits (mpmath): points in millimetres and their pixels.
#[test]
fn points_are_imaged_where_the_formulas_say() {
    let moving = central().with_pupil(Pupil::from_mm([2.77, 0.056])).unwrap();
    let lens = moving.with_asymmetry(ASYMMETRY).unwrap();
    for ([x, y, z], u, v) in [
        ([200.0, 0.0, 100.0], 1651.6241373563, 1022.96995905071),
        ([0.0, -350.0, -40.0], 1026.62120932355, 155.255191325212),
        ([150.0, 100.0, 300.0], 1290.34216114092, 1201.02603539705),
        ([30.0, 0.0, -5.0], 1933.52213285286, 1022.17073179126),
        ([1.0, 2.0, 500.0], 1025.19821499139, 1026.39635809193),
    ] {
        let pixel = lens.project_point(&Point::<Camera>::from_mm(Vector3::new(x, y, z))).unwrap();
        assert!((pixel.u - u).abs() < 1e-9 && (pixel.v - v).abs() < 1e-9, "{pixel:?}");
    }
}

/// FISHEYE624 of Project Aria, which has six radial coefficients: f = 600, c = (1024, 1022); vectors of the design notes, made by other code.
#[test]
fn the_asymmetry_is_that_of_fisheye624() {
    let k = [-0.02, 0.003, -0.001, 0.0002, -1e-5, 1e-6];
    let asymmetry = Asymmetry { tangential: [1e-3, -5e-4], prism: [2e-4, -1e-4, 3e-4, 5e-5], growth: [0.0; 2] };
    for ([x, y, z], u, v) in
        [([0.3, -0.2, 0.9], 1213.947358211, 895.420190998), ([-0.7, 0.4, -0.1], 184.906396393, 1502.216843003)]
    {
        let (rho, theta) = (f64::hypot(x, y), f64::hypot(x, y).atan2(z));
        let grown = k.iter().enumerate().map(|(i, k)| k * theta.powi(2 * i as i32 + 3)).sum::<f64>() + theta;
        let at = asymmetry.moved(Vector2::new(x, y) * (grown / rho)) * 600.0;
        assert!((1024.0 + at.x - u).abs() < 1e-6 && (1022.0 + at.y - v).abs() < 1e-6, "{at}");
    }
}

#[test]
fn without_coefficients_all_is_as_by_the_central_lens() {
    let lens = central().with_asymmetry(Asymmetry::default()).unwrap();
    assert_eq!(lens, central());
    assert!(lens.fits_opencv() && !central().with_asymmetry(ASYMMETRY).unwrap().fits_opencv());
}

#[test]
fn coefficients_that_fold_the_image_are_refused() {
    let with = |p: f64| central().with_asymmetry(Asymmetry { tangential: [p, 0.0], ..Asymmetry::default() });
    assert_eq!(with(0.3), Err(InvalidLens::Folds));
    assert_eq!(with(f64::NAN), Err(InvalidLens::NotFinite));
    assert!(with(0.05).is_ok());
    // No pixel of the sensor's corners has a ray, however far the field reaches.
    let lens = with(0.05).unwrap();
    assert!(lens.unproject::<Camera>(Pixel { u: -4000.0, v: 9000.0 }).is_err());
}

#[test]
fn a_wider_or_coarser_lens_stays_asymmetric() {
    let lens = central().with_asymmetry(ASYMMETRY).unwrap();
    let half = lens.resampled(1024).unwrap();
    let (whole, half) = (lens.project(&ray(1.2, 0.7)).unwrap(), half.project(&ray(1.2, 0.7)).unwrap());
    assert!(((whole.u + 0.5) / 2.0 - 0.5 - half.u).abs() < 1e-9 && ((whole.v + 0.5) / 2.0 - 0.5 - half.v).abs() < 1e-9);
    assert_eq!(lens.extrapolated().asymmetry(), ASYMMETRY);
}

proptest! {
    /// By central differences, of the direction of a ray and of every parameter that moves its pixel.
    #[test]
    fn derivatives_agree_with_differences(theta in 0.0..1.7f64, phi in -3.2..3.2f64) {
        let (lens, ray) = (of(PARAMETERS), ray(theta, phi));
        let pixel = lens.project(&ray).unwrap();
        let (by_ray, by_pixel) = (lens.pixel_by_ray(&ray), lens.ray_by_pixel(&ray));
        prop_assert!((by_ray * by_pixel - Matrix2::identity()).amax() < 1e-12);
        let moved = |du: f64, dv: f64| lens.unproject::<Camera>(Pixel { u: pixel.u + du, v: pixel.v + dv }).unwrap().vector();
        let h = 1e-3;
        prop_assert!((by_pixel.column(0) - (moved(h, 0.0) - moved(-h, 0.0)) / (2.0 * h)).amax() < 1e-9);
        prop_assert!((by_pixel.column(1) - (moved(0.0, h) - moved(0.0, -h)) / (2.0 * h)).amax() < 1e-9);
        let by_lens = lens.pixel_by_lens(&ray);
        for i in 0..LENS_PARAMETERS {
            let step = if i < 4 { 1e-3 } else { 1e-6 };
            let seen = |sign: f64| {
                let mut parameters = PARAMETERS;
                parameters[i] += sign * step;
                of(parameters).project(&ray).unwrap()
            };
            let (above, below) = (seen(1.0), seen(-1.0));
            for (row, change) in [above.u - below.u, above.v - below.v].into_iter().enumerate() {
                let expected = change / (2.0 * step);
                let off = (by_lens[(row, i)] - expected).abs();
                prop_assert!(off < 1e-6 * expected.abs().max(1.0), "{i} at {theta}: {} {expected}", by_lens[(row, i)]);
            }
        }
    }

    #[test]
    fn batches_give_what_single_points_give(theta in 0.01..1.7f64, phi in -3.2..3.2f64) {
        let (lens, ray) = (of(PARAMETERS), ray(theta, phi));
        let point: [f64; 3] = (ray.vector() * 300.0).into();
        let pixel = lens.project(&ray).unwrap();
        for instructions in [Instructions::Best, Instructions::Baseline] {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            let [[u, v], [outside, _]] = batch.project(&[point, [0.0, 0.0, -1.0]])[..] else { panic!("two pixels") };
            prop_assert!((u - pixel.u).hypot(v - pixel.v) < 1e-9 && outside.is_nan());
            let rays = batch.unproject(&[[pixel.u, pixel.v], [-4000.0, 9000.0]]);
            prop_assert!((Vector3::from(rays[0]) - ray.vector()).norm() < 1e-12 && rays[1][0].is_nan());
            let found = batch.project_with_derivatives(&[point]);
            let at = found.pixel(0).unwrap();
            prop_assert!((at.u - pixel.u).hypot(at.v - pixel.v) < 1e-9);
            prop_assert!((found.by_point(0).unwrap() * 300.0 - lens.pixel_by_ray(&ray)).amax() < 1e-9 * 600.0);
            let by_lens = lens.pixel_by_lens(&ray);
            prop_assert!((found.by_lens(0).unwrap() - by_lens).amax() < 1e-11 * by_lens.amax());
        }
    }
}

/// For programs that know of no such lens. What an element off the axis does to the image is by far the most a shift of the centre.
#[test]
fn a_symmetric_lens_stands_in() {
    let lens = of(PARAMETERS);
    let stand_in = lens.central_at(Length::from_mm(500.0)).unwrap();
    assert!(stand_in.fits_opencv());
    let dropped = of({
        let mut parameters = PARAMETERS;
        parameters[10..16].fill(0.0);
        parameters[18..].fill(0.0);
        parameters
    });
    let dropped = dropped.central_at(Length::from_mm(500.0)).unwrap();
    let off = |central: &KannalaBrandt| lens.largest_difference(central, Length::from_mm(500.0));
    assert!(off(&stand_in) < 0.8 * off(&dropped), "{} {}", off(&stand_in), off(&dropped));
}
