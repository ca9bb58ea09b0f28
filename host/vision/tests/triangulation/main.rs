//! Triangulation and epipolar angles against computed vectors.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod covariance;
mod laws;

use nalgebra::Vector3;
use vergence_vision::{
    Angle, Left, Point, Rejection, UnitRay, closest_approach, dihedral, midpoint, pseudo_intersection, ray_to_plane,
};

fn ray(x: f64, y: f64, z: f64) -> UnitRay<Left> {
    UnitRay::new(Vector3::new(x, y, z)).unwrap()
}

fn towards(vector: Vector3<f64>) -> UnitRay<Left> {
    UnitRay::new(vector).unwrap()
}

fn point(x: f64, y: f64, z: f64) -> Point<Left> {
    Point::from_mm(Vector3::new(x, y, z))
}

fn assert_near(found: Vector3<f64>, expected: [f64; 3], tolerance: f64) {
    assert!((found - Vector3::from(expected)).amax() <= tolerance, "{found:?}, expected {expected:?}");
}

/// Half a unit of the eighth printed digit.
const PRINTED: f64 = 0.5e-8 + 1e-10;

/// Evaluated with numpy from the formulas with 1 - (u·v)² in the denominator.
#[test]
fn skew_rays_in_front() {
    let (u, v, t) = (ray(0.2, 0.05, 1.0), ray(-0.25, -0.02, 1.0), point(145.0, 0.0, 0.0));
    let feet = closest_approach(&u, &v, &t).unwrap();
    assert!((feet.left_range.mm() - 320.99216592).abs() <= PRINTED, "{feet:?}");
    assert!((feet.right_range.mm() - 324.54631035).abs() <= PRINTED, "{feet:?}");
    let expected = [64.58849316, 4.71155781, 314.58899925];
    assert_near(midpoint(&u, &v, &t).unwrap().point.mm(), expected, PRINTED);
    let expected = [64.40692044, 4.82559893, 322.20348333];
    assert_near(pseudo_intersection(&u, &v, &t).unwrap().point.mm(), expected, PRINTED);
}

/// The rays themselves are printed to eight digits, which the division by the sine of the parallax magnifies.
#[test]
fn skew_rays_of_a_turned_rig() {
    const ROUNDED_RAYS: f64 = 2e-6;
    let (u, v) = (ray(-0.09926322, 0.06948426, 0.99263223), ray(-0.62750907, 0.08543577, 0.77390768));
    let t = point(140.0, 3.0, -12.0);
    let feet = closest_approach(&u, &v, &t).unwrap();
    assert!((feet.left_range.mm() - 184.54724508).abs() <= ROUNDED_RAYS, "{feet:?}");
    assert!((feet.right_range.mm() - 251.24284016).abs() <= ROUNDED_RAYS, "{feet:?}");
    let expected = [-17.9879576, 18.64412626, 182.81315384];
    assert_near(midpoint(&u, &v, &t).unwrap().point.mm(), expected, ROUNDED_RAYS);
    let expected = [-18.69389606, 18.8047214, 184.54755304];
    assert_near(pseudo_intersection(&u, &v, &t).unwrap().point.mm(), expected, ROUNDED_RAYS);
}

/// The right camera matches `up` millimetres along a vertical edge at (72.5, 0, 350): the midpoint is biased as stated.
#[test]
fn the_midpoint_is_biased_by_a_vertical_mismatch_and_the_pseudo_intersection_is_not() {
    let t = point(145.0, 0.0, 0.0);
    for (up, bias, digit) in [(5.0, -0.416, 0.001), (20.0, -6.53, 0.01), (50.0, -37.0, 0.1)] {
        let (u, v) = (ray(72.5, 0.0, 350.0), ray(-72.5, up, 350.0));
        let error = |z: f64| z - 350.0;
        let by_midpoint = error(midpoint(&u, &v, &t).unwrap().point.mm().z);
        let by_plane = error(pseudo_intersection(&u, &v, &t).unwrap().point.mm().z);
        assert!((by_midpoint - bias).abs() <= digit, "{up}: {by_midpoint}");
        assert!(by_plane.abs() <= 0.0005, "{up}: {by_plane}");
    }
}

#[test]
fn rays_that_make_no_point_are_rejected_with_the_reason() {
    use Rejection::{Diverging, OnBaseline, Parallel};
    let t = point(145.0, 0.0, 0.0);
    let cases = [
        (ray(0.0, 0.0, 1.0), ray(0.0, 0.0, 1.0), t, Parallel),
        (ray(0.0, 0.0, 1.0), ray(1e-11, 0.0, 1.0), t, Parallel),
        (ray(0.0, 0.0, 1.0), ray(0.0, 0.0, -1.0), t, Parallel),
        (ray(-0.1, 0.0, 1.0), ray(0.1, 0.0, 1.0), t, Diverging),
        (ray(0.0, 0.0, 1.0), ray(0.1, 0.0, 1.0), t, Diverging),
        (ray(0.1, 0.0, 1.0), ray(-0.1, 0.0, -1.0), point(0.0, 0.0, 0.0), Parallel),
        (ray(0.1, 0.0, 1.0), ray(-0.1, 0.0, 1.0), point(0.0, 0.0, 0.0), OnBaseline),
        (ray(1.0, 0.0, 0.0), ray(0.0, 0.0, 1.0), t, OnBaseline),
        (ray(0.1, 0.0, 1.0), ray(-0.1, 0.0, 1.0), point(f64::NAN, 0.0, 0.0), OnBaseline),
        (ray(0.1, 0.0, 1.0), ray(-0.1, 0.0, 1.0), point(f64::INFINITY, 0.0, 0.0), OnBaseline),
    ];
    for (u, v, t, expected) in cases {
        assert_eq!(pseudo_intersection(&u, &v, &t), Err(expected), "{u:?} {v:?} {t:?}");
        assert_eq!(midpoint(&u, &v, &t), Err(expected), "{u:?} {v:?} {t:?}");
    }
}

/// The two conditions on the sign differ for very skew rays: feet in front but the projected rays meet behind, and the
/// other way round.
#[test]
fn very_skew_rays_must_meet_in_front_in_both_senses() {
    let t = point(1.0, 0.0, 0.0);
    let (u, v) = (ray(0.529, -0.645, 0.551), ray(-0.349, -0.118, -0.930));
    assert!(closest_approach(&u, &v, &t).unwrap().in_front());
    assert_eq!(pseudo_intersection(&u, &v, &t), Err(Rejection::Diverging));
    let (u, v) = (ray(-0.678, 0.606, -0.416), ray(-0.640, 0.120, -0.759));
    assert!(!closest_approach(&u, &v, &t).unwrap().in_front());
    assert_eq!(pseudo_intersection(&u, &v, &t), Err(Rejection::Diverging));
}

/// The foot on the left ray is at the left centre, so the common plane is the right ray's, in which both are parallel.
#[test]
fn skew_rays_with_parallel_projections_are_rejected() {
    let (u, v, t) = (ray(-0.75 + 1e-11, 1.0, 1.0), ray(-0.6, 0.0, 0.8), point(145.0, 0.0, 0.0));
    assert!(closest_approach(&u, &v, &t).unwrap().in_front());
    assert_eq!(pseudo_intersection(&u, &v, &t), Err(Rejection::Parallel));
}

/// A sideways rig, so that the point lies past 90° of the optical axis.
#[test]
fn points_behind_the_image_plane_triangulate() {
    let (p, t) = (Vector3::new(300.0, 20.0, -60.0), point(20.0, 0.0, -145.0));
    let found = pseudo_intersection(&towards(p), &towards(p - t.mm()), &t).unwrap();
    assert_near(found.point.mm(), [300.0, 20.0, -60.0], 1e-9);
}

#[test]
fn epipolar_angles_have_the_stated_sign_and_size() {
    let t = point(145.0, 0.0, 0.0);
    // Turning about x from y to z is positive: z to -y.
    let (level, up) = (ray(0.3, 0.0, 1.0), ray(-0.2, -0.1, 1.0));
    let angle = dihedral(&level, &up, &t).unwrap();
    assert!((angle.rad() - 0.1f64.atan()).abs() < 1e-15, "{angle}");
    assert!((dihedral(&up, &level, &t).unwrap() + angle).rad().abs() < 1e-15);
    // The right ray has the larger sine to the baseline, so the left ray is measured against its plane.
    let expected = angle.rad().sin() / 1.09f64.sqrt();
    assert!((ray_to_plane(&level, &up, &t).unwrap().rad().sin() - expected).abs() < 1e-15);
}

#[test]
fn near_an_epipole_the_dihedral_is_large_and_the_angle_to_the_plane_is_not() {
    let t = point(145.0, 0.0, 0.0);
    let (u, v) = (ray(1.0, 0.001, 0.0), ray(0.0, 0.0, 1.0));
    assert!(dihedral(&u, &v, &t).unwrap().abs().deg() > 89.0);
    assert!(ray_to_plane(&u, &v, &t).unwrap().abs().rad() < 0.0011);
    let along = ray(1.0, 0.0, 0.0);
    assert_eq!(dihedral(&along, &v, &t), None);
    assert_eq!(ray_to_plane(&along, &v, &t), Some(Angle::default()));
    assert_eq!(ray_to_plane(&along, &along, &t), None);
    assert_eq!(ray_to_plane(&u, &v, &point(0.0, 0.0, 0.0)), None);
    assert_eq!(ray_to_plane(&u, &v, &point(f64::NAN, 0.0, 0.0)), None);
}
