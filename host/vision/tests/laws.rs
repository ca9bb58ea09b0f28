//! Laws of the camera model, the rays and the units.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, Left, Length, OutsideField, Pixel, Right, Transform, UnitRay,
};

const SIZE: ImageSize = ImageSize { width: 1920, height: 1536 };
const CENTRE: Pixel = Pixel { u: 957.3, v: 771.9 };

/// f = 599 px with fields and shapes from nearly equidistant to strongly bent; the last grows at only a tenth of f.
fn lenses() -> Vec<KannalaBrandt> {
    let shapes: [([f64; 4], f64, f64); 5] = [
        ([0.0; 4], 1.0, 120.0),
        ([0.01, -0.004, 0.001, -0.0002], 0.9975, 99.5),
        ([-0.006, 0.042, -0.038, 0.0066], 1.0, 99.5),
        ([0.04, 0.01, -0.012, 0.001], 1.02, 99.5),
        ([-0.1, 0.0, 0.0, 0.0], 1.0, 99.5),
    ];
    shapes
        .into_iter()
        .map(|([a, b, c, d], aspect, degrees)| {
            let k = [1.0, a, b, c, d].map(|k| 599.0 * k);
            KannalaBrandt::new(k, aspect, CENTRE, Angle::from_deg(degrees), SIZE).unwrap()
        })
        .collect()
}

fn ray(theta: f64, phi: f64) -> UnitRay<Camera> {
    UnitRay::new(Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())).unwrap()
}

/// Stays accurate where the angle is small, unlike the arc cosine.
fn angle_between(a: &UnitRay<Camera>, b: &UnitRay<Camera>) -> f64 {
    a.vector().cross(&b.vector()).norm().atan2(a.vector().dot(&b.vector()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_pixel_returns_to_itself(lens in 0usize..5, part in 0.0..0.999_999f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let pixel = lens.project(&ray(part * lens.theta_max().rad(), phi)).unwrap();
        let back = lens.project(&lens.unproject::<Camera>(pixel).unwrap()).unwrap();
        prop_assert!((pixel.u - back.u).hypot(pixel.v - back.v) < 1e-9, "{:?} became {:?}", pixel, back);
    }

    #[test]
    fn a_ray_returns_to_itself(lens in 0usize..5, part in 0.0..0.999_999f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let ray = ray(part * lens.theta_max().rad(), phi);
        let back = lens.unproject(lens.project(&ray).unwrap()).unwrap();
        prop_assert!(angle_between(&ray, &back) < 1e-12, "{:?} became {:?}", ray, back);
    }

    /// With pixels half as large, pixel n lies where 2n and 2n + 1 meet.
    #[test]
    fn a_ray_keeps_its_place_on_a_sensor_of_other_pixels(lens in 0usize..5, part in 0.0..0.99f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let fine = lens.resampled(2 * SIZE.width).unwrap();
        prop_assert_eq!(fine.size(), ImageSize { width: 2 * SIZE.width, height: 2 * SIZE.height });
        let ray = ray(part * lens.theta_max().rad(), phi);
        let (coarse, fine) = (lens.project(&ray).unwrap(), fine.project(&ray).unwrap());
        let off = (2.0 * coarse.u + 0.5 - fine.u).hypot(2.0 * coarse.v + 0.5 - fine.v);
        prop_assert!(off < 1e-9, "{:?} became {:?}", coarse, fine);
    }

    #[test]
    fn a_ray_near_the_axis_returns_to_itself(lens in 0usize..5, exponent in -300.0..-3.0f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let ray = ray(10f64.powf(exponent), phi);
        let back = lens.unproject(lens.project(&ray).unwrap()).unwrap();
        prop_assert!(angle_between(&ray, &back) < 1e-12, "{:?} became {:?}", ray, back);
    }

    #[test]
    fn rays_beyond_the_field_have_no_pixel(lens in 0usize..5, beyond in 1e-9..1.0f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let limit = lens.theta_max().rad();
        let theta = limit + beyond * (std::f64::consts::PI - limit);
        prop_assert_eq!(lens.project(&ray(theta, phi)), Err(OutsideField));
    }

    #[test]
    fn pixels_beyond_the_field_have_no_ray(lens in 0usize..5, beyond in 1e-6..1e6f64, phi in -3.2..3.2f64) {
        let lens = lenses()[lens];
        let edge = lens.project(&ray(lens.theta_max().rad() * (1.0 - 1e-12), phi)).unwrap();
        let outward = 1.0 + beyond;
        let pixel = Pixel {
            u: CENTRE.u + outward * (edge.u - CENTRE.u),
            v: CENTRE.v + outward * (edge.v - CENTRE.v),
        };
        prop_assert_eq!(lens.unproject::<Camera>(pixel), Err(OutsideField));
    }

    #[test]
    fn pixels_per_radian_is_the_slope_of_the_projection(lens in 0usize..5, part in 0.01..0.99f64) {
        let lens = lenses()[lens];
        let (theta, step) = (part * lens.theta_max().rad(), 1e-6);
        let column = |theta| lens.project(&ray(theta, 0.0)).unwrap().u;
        let slope = (column(theta + step) - column(theta - step)) / (2.0 * step);
        prop_assert!((slope - lens.pixels_per_radian(Angle::from_rad(theta))).abs() < 1e-5 * 599.0);
    }

    #[test]
    fn unprojection_gives_unit_rays_or_refuses(lens in 0usize..5, u in any::<f64>(), v in any::<f64>()) {
        if let Ok(ray) = lenses()[lens].unproject::<Camera>(Pixel { u, v }) {
            prop_assert!((ray.vector().norm() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_transform_and_its_inverse_cancel(
        axis in [-2.0..2.0f64, -2.0..2.0, -2.0..2.0],
        x in [-1e3..1e3f64, -1e3..1e3, -1e3..1e3],
    ) {
        let left_from_right =
            Transform::<Left, Right>::new(UnitQuaternion::from_scaled_axis(Vector3::from(axis)), Vector3::from(x));
        let point = vergence_vision::Point::<Right>::from_mm(Vector3::from(x).yzx());
        let back = left_from_right.inverse() * (left_from_right * point);
        prop_assert!((back.mm() - point.mm()).norm() < 1e-9);
    }

    #[test]
    fn lengths_and_angles_read_back_what_they_print(value in -1e9..1e9f64) {
        let (length, angle) = (Length::from_mm(value), Angle::from_deg(value));
        prop_assert_eq!(length.to_string().parse::<Length>(), Ok(length));
        let read: Angle = angle.to_string().parse().unwrap();
        prop_assert!((read.deg() - angle.deg()).abs() <= 1e-14 * value.abs());
    }
}

#[test]
fn pixels_that_are_not_numbers_are_refused() {
    for lens in lenses() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
            for pixel in [Pixel { u: bad, v: 700.0 }, Pixel { u: 900.0, v: bad }, Pixel { u: bad, v: bad }] {
                assert_eq!(lens.unproject::<Camera>(pixel), Err(OutsideField));
                assert!(!lens.on_sensor(pixel));
            }
        }
    }
}

#[test]
fn the_optical_centre_is_seen_nowhere() {
    let origin = vergence_vision::Point::<Camera>::from_mm(Vector3::zeros());
    assert_eq!(lenses()[0].project_point(&origin), Err(OutsideField));
}

#[test]
fn the_edge_of_the_sensor_is_half_a_pixel_out() {
    let lens = lenses()[0];
    for (u, v, inside) in [(-0.5, -0.5, true), (-0.51, 0.0, false), (1919.5, 1535.5, true), (1919.51, 0.0, false)] {
        assert_eq!(lens.on_sensor(Pixel { u, v }), inside, "{u} {v}");
    }
}

/// k1 = -0.115 alone turns over at sqrt(1 / 0.345) rad = 97.55°.
#[test]
fn a_polynomial_that_turns_over_in_the_field_is_refused() {
    let k = [599.0, -0.115 * 599.0, 0.0, 0.0, 0.0];
    let lens = |degrees| KannalaBrandt::new(k, 1.0, CENTRE, Angle::from_deg(degrees), SIZE);
    assert!(lens(97.5).is_ok());
    let message = lens(99.5).unwrap_err().to_string();
    assert!(message.contains("turns over at 97.55°") && message.contains("theta_max = 99.50°"), "{message}");
}

#[test]
fn parameters_of_no_lens_are_refused() {
    let k = [599.0, 0.0, 0.0, 0.0, 0.0];
    let field = Angle::from_deg(98.0);
    let new = |k, aspect, theta| KannalaBrandt::new(k, aspect, CENTRE, theta, SIZE).map(|_| ());
    assert_eq!(new([0.0; 5], 1.0, field), Err(InvalidLens::FocalLength));
    assert_eq!(new(k, -1.0, field), Err(InvalidLens::FocalLength));
    assert_eq!(new([599.0, 0.0, f64::NAN, 0.0, 0.0], 1.0, field), Err(InvalidLens::NotFinite));
    assert_eq!(new(k, 1.0, Angle::from_rad(f64::NAN)), Err(InvalidLens::NotFinite));
    for degrees in [0.0, -10.0, 180.0] {
        let theta = Angle::from_deg(degrees);
        assert_eq!(new(k, 1.0, theta), Err(InvalidLens::ThetaMax(theta)));
    }
}

/// Their squares overflow to infinity or vanish; dividing by such a norm once made a "unit" vector of length zero.
#[test]
fn very_long_and_very_short_vectors_have_a_direction() {
    let expected = Vector3::new(0.6, 0.0, -0.8);
    for scale in [1e-320, 1e-200, 1.0, 1e200, 1e307] {
        let ray = UnitRay::<Camera>::new(Vector3::new(3.0, 0.0, -4.0) * scale).unwrap();
        assert!(
            (ray.vector() - expected).norm() < 1e-3 && (ray.vector().norm() - 1.0).abs() < 1e-12,
            "{scale}: {ray:?}"
        );
    }
    for bad in [[0.0, 0.0, 0.0], [f64::NAN, 1.0, 0.0], [f64::INFINITY, 1.0, 0.0], [1.0, f64::NEG_INFINITY, f64::NAN]] {
        assert_eq!(UnitRay::<Camera>::new(Vector3::from(bad)), None);
    }
}

#[test]
fn quantities_are_read_with_their_units() {
    for (text, mm) in [("145mm", 145.0), (" 14.5 cm ", 145.0), ("0.145m", 145.0), ("20um", 0.02), ("-2e1µm", -0.02)] {
        assert!((text.parse::<Length>().unwrap().mm() - mm).abs() < 1e-12, "{text}");
    }
    for (text, deg) in [("120deg", 120.0), ("-40°", -40.0), ("1e1 deg", 10.0), ("1rad", 1f64.to_degrees())] {
        assert!((text.parse::<Angle>().unwrap().deg() - deg).abs() < 1e-12, "{text}");
    }
}

#[test]
fn quantities_without_a_known_unit_are_refused() {
    for text in ["145", "12 parsecs", "NaNmm", "infmm", "mm", "", "1e999mm", "1,5mm", "3deg", "1mmm", "0x1mm"] {
        let refusal = text.parse::<Length>().unwrap_err().to_string();
        assert!(refusal.contains("a length") && refusal.contains("145mm"), "{text}: {refusal}");
    }
    for text in ["120", "3 mm", "NaN°", "deg", "", "1e999rad", "2 degrees"] {
        assert!(text.parse::<Angle>().is_err(), "{text}");
    }
}
