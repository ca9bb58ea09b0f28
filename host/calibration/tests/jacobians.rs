//! Analytic derivatives against dual numbers.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use num_dual::{Dual64, DualNum};
use proptest::prelude::*;
use vergence_calibration::{LensParameters, reproject};
use vergence_vision::{LENS_PARAMETERS, Point};

/// The projection of Kannala and Brandt, eq. 6, with a pupil that moves and elements off the axis, written down once more for numbers that
/// carry a derivative.
fn projected(lens: [Dual64; LENS_PARAMETERS], [x, y, z]: [Dual64; 3]) -> [Dual64; 2] {
    let [fx, fy, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4] = lens;
    let rho = (x * x + y * y).sqrt();
    let mut theta = rho.atan2(z);
    for _ in 0..8 {
        // Newton's steps on ρ cos θ - (z - e) sin θ, with e = (θ / sin θ - 1) (e0 + e1 θ²).
        let (sine, cosine) = theta.sin_cos();
        let (shift, growth) = (theta / sine - 1.0, e1 * theta * theta + e0);
        let slope = (sine - theta * cosine) / (sine * sine) * growth + shift * e1 * theta * 2.0;
        let e = shift * growth;
        theta += (rho * cosine - (z - e) * sine) / (rho * sine + (z - e) * cosine - slope * sine);
    }
    let t = theta * theta;
    let radius = theta * ((((((k6 * t + k5) * t + k4) * t + k3) * t + k2) * t + k1) * t + 1.0);
    let (m, n) = (radius * x / rho, radius * y / rho);
    let square = m * m + n * n;
    let (p1, p2) = (p3 * square + p1, p4 * square + p2);
    let along = (m * p1 + n * p2) * 2.0;
    let (u, v) = (s1 * square + s0 + p1, s3 * square + s2 + p2);
    [cx + fx * (along * m + m + u * square), cy + fy * (along * n + n + v * square)]
}

/// Fisheye parameters, and a point 50 mm to 2 m away at 1° to 150° from the axis.
fn lens_and_point() -> impl Strategy<Value = ([f64; LENS_PARAMETERS], [f64; 3])> {
    let lens = (
        150.0..900.0,
        0.9..1.1,
        -50.0..1500.0,
        -50.0..1500.0,
        prop::array::uniform4(-0.05..0.05),
        prop_oneof![Just([0.0; 2]), (-1.0..3.0, -0.3..0.3_f64).prop_map(|(e0, e1)| [e0, e1])],
        prop_oneof![Just([0.0; 8]), prop::array::uniform8(-0.01..0.01)],
        prop_oneof![Just([0.0; 2]), prop::array::uniform2(-1e-4..1e-4)],
    );
    let point = (1.0..150.0_f64, -180.0..180.0_f64, 50.0..2000.0);
    (lens, point).prop_map(
        |((fx, aspect, cx, cy, [k1, k2, k3, k4], [e0, e1], asymmetry, [k5, k6]), (theta, phi, range))| {
            let [p1, p2, s0, s1, s2, s3, p3, p4] = asymmetry;
            let (sin, cos) = theta.to_radians().sin_cos();
            let (sin_phi, cos_phi) = phi.to_radians().sin_cos();
            let point = [range * sin * cos_phi, range * sin * sin_phi, range * cos];
            ([fx, fx * aspect, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4], point)
        },
    )
}

fn lens(parameters: [f64; LENS_PARAMETERS]) -> LensParameters {
    LensParameters::from_array(parameters)
}

/// The dual-number derivative of the projection by parameter `index` of lens, then point.
fn derivative(parameters: [f64; LENS_PARAMETERS], point: [f64; 3], index: usize) -> [f64; 2] {
    let seed = |i: usize, x: f64| Dual64::new(x, if i == index { 1.0 } else { 0.0 });
    let mut i = 0..;
    let mut next = |x| seed(i.next().unwrap(), x);
    let (parameters, point) = (parameters.map(&mut next), point.map(&mut next));
    projected(parameters, point).map(|d| d.eps)
}

fn close(a: [f64; 2], b: [f64; 2], scale: f64) -> bool {
    (0..2).all(|i| (a[i] - b[i]).abs() <= 1e-9 * scale.max(a[i].abs()))
}

proptest! {
    #[test]
    fn the_projection_agrees_with_dual_numbers((parameters, point) in lens_and_point()) {
        let reprojection = reproject(lens(parameters), &Point::from_mm(point.into())).unwrap();
        let plain = projected(parameters.map(Dual64::from), point.map(Dual64::from)).map(|d| d.re);
        prop_assert!(close(reprojection.pixel, plain, 1.0), "{:?} {:?}", reprojection.pixel, plain);
        for (index, column) in reprojection.by_lens.iter().chain(&reprojection.by_point).enumerate() {
            let dual = derivative(parameters, point, index);
            prop_assert!(close(*column, dual, 1.0), "parameter {index}: {column:?}, dual numbers {dual:?}");
        }
    }

    /// On both sides of the angle where the series takes over the quotients.
    #[test]
    fn the_series_near_the_axis_joins(
        (parameters, _) in lens_and_point(), theta in 0.9e-4..1.1e-4, phi in -3.2..3.2_f64, z in 50.0..2000.0,
    ) {
        let rho: f64 = z * f64::tan(theta);
        let point = [rho * phi.cos(), rho * phi.sin(), z];
        let reprojection = reproject(lens(parameters), &Point::from_mm(point.into())).unwrap();
        for (index, column) in reprojection.by_lens.iter().chain(&reprojection.by_point).enumerate() {
            let dual = derivative(parameters, point, index);
            // The quotients themselves lose digits here: nine remain of the largest derivative.
            prop_assert!((0..2).all(|i| (column[i] - dual[i]).abs() < 1e-7), "{index}: {column:?}, {dual:?}");
        }
    }
}

#[test]
fn on_the_axis_the_projection_is_the_principal_point() {
    let lens = lens([
        300.0, 310.0, 500.0, 400.0, 0.01, 0.0, 0.0, 0.0, 2.0, 0.1, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, -1e-5, 1e-3,
        -2e-3,
    ]);
    let reprojection = reproject(lens, &Point::from_mm([0.0, 0.0, 200.0].into())).unwrap();
    assert!(close(reprojection.pixel, [500.0, 400.0], 1.0));
    assert!(close(reprojection.by_point[0], [1.5, 0.0], 1.0));
    assert!(close(reprojection.by_point[1], [0.0, 1.55], 1.0));
    assert!(close(reprojection.by_point[2], [0.0, 0.0], 1.0));
}

#[test]
fn the_centre_and_straight_behind_have_no_projection() {
    let lens = lens([
        300.0, 310.0, 500.0, 400.0, 0.01, 0.0, 0.0, 0.0, 2.0, 0.1, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, -1e-5, 1e-3,
        -2e-3,
    ]);
    for point in [[0.0; 3], [0.0, 0.0, -10.0], [f64::NAN, 0.0, 1.0]] {
        assert_eq!(reproject(lens, &Point::from_mm(point.into())), None);
    }
}
