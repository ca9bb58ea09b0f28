//! Triangulation, epipolar angles and covariance: computed vectors, laws, and a seeded Monte Carlo.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Left, Point, Rejection, UnitRay, closest_approach, covariance, dihedral, midpoint, pseudo_intersection,
    range_sigma, ray_to_plane,
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

/// On the midline 350 mm ahead of a baseline of 145 mm: σ = 1 mrad makes 1.246, 0.258 and 0.253 mm.
#[test]
fn covariance_on_the_midline() {
    let (p, t) = (point(72.5, 0.0, 350.0), point(145.0, 0.0, 0.0));
    let c = covariance(&p, &t, Angle::from_rad(1e-3)).unwrap();
    for (variance, sigma) in [(c.m33, 1.2460), (c.m11, 0.2581), (c.m22, 0.2527)] {
        assert!((variance.sqrt() - sigma).abs() <= 5.1e-5, "{} {sigma}", variance.sqrt());
    }
    let along = p.direction().unwrap().vector();
    let expected = along.dot(&(c * along)).sqrt();
    assert!((range_sigma(&c, &p).unwrap().mm() - expected).abs() < 1e-12);
}

#[test]
fn covariance_is_refused_where_there_is_none() {
    let (p, t, sigma) = (point(72.5, 0.0, 350.0), point(145.0, 0.0, 0.0), Angle::from_rad(1e-3));
    assert_eq!(covariance(&point(300.0, 0.0, 0.0), &t, sigma), None);
    assert_eq!(covariance(&point(0.0, 0.0, 0.0), &t, sigma), None);
    assert_eq!(covariance(&p, &point(0.0, 0.0, 0.0), sigma), None);
    assert_eq!(covariance(&point(f64::NAN, 0.0, 1.0), &t, sigma), None);
    assert_eq!(covariance(&point(f64::INFINITY, 0.0, 1.0), &t, sigma), None);
    assert_eq!(covariance(&p, &t, Angle::from_rad(f64::NAN)), None);
    assert_eq!(range_sigma(&Matrix3::identity(), &point(0.0, 0.0, 0.0)), None);
}

/// Gaussian numbers from SplitMix64 (Steele, Lea and Flood, 2014) by the Box-Muller method.
struct Gaussian(u64);

impl Gaussian {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (0.5f64).powi(53)
    }

    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// `ray` turned by an angle of standard deviation `sigma` in each of its two directions.
    fn disturb(&mut self, ray: &UnitRay<Left>, sigma: f64) -> UnitRay<Left> {
        let noise = Vector3::new(self.next(), self.next(), self.next()) * sigma;
        towards(ray.vector() + noise)
    }
}

/// The normalised estimation error squared has mean 3 and variance 6; its mean over n trials stays within four sigma.
#[test]
fn errors_are_as_large_as_the_covariance_says() {
    const TRIALS: u32 = 20_000;
    const SIGMA: f64 = 1e-4;
    let mut gaussian = Gaussian(20_240_229);
    for (p, t) in [
        ([72.5, 0.0, 350.0], [145.0, 0.0, 0.0]),
        ([225.0, 120.0, 268.0], [145.0, 0.0, 0.0]),
        ([340.0, 30.0, -40.0], [145.0, 3.0, -12.0]),
        ([-120.0, -60.0, 900.0], [140.0, 3.0, -12.0]),
    ] {
        let (p, t) = (Vector3::from(p), Point::from_mm(Vector3::from(t)));
        let (u, v) = (towards(p), towards(p - t.mm()));
        let c = covariance(&Point::from_mm(p), &t, Angle::from_rad(SIGMA)).unwrap();
        let information = c.try_inverse().unwrap();
        let (mut nees, mut range_squared) = (0.0, 0.0);
        for _ in 0..TRIALS {
            let (u, v) = (gaussian.disturb(&u, SIGMA), gaussian.disturb(&v, SIGMA));
            let found = pseudo_intersection(&u, &v, &t).unwrap();
            let error = found.point.mm() - p;
            nees += error.dot(&(information * error)) / f64::from(TRIALS);
            range_squared += (found.left_range.mm() - p.norm()).powi(2) / f64::from(TRIALS);
        }
        let band = 4.0 * (6.0 / f64::from(TRIALS)).sqrt();
        assert!((nees - 3.0).abs() < band, "{p:?}: {nees} is not within {band} of 3");
        let ratio = range_squared.sqrt() / range_sigma(&c, &Point::from_mm(p)).unwrap().mm();
        assert!((ratio - 1.0).abs() < 4.0 / (2.0 * f64::from(TRIALS)).sqrt(), "{p:?}: {ratio}");
    }
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

/// A right centre and a point that both cameras see at more than 3° from the baseline.
fn scene() -> impl Strategy<Value = (Point<Left>, Vector3<f64>)> {
    (vector(300.0), vector(2000.0))
        .prop_filter("well conditioned", |(t, p)| {
            let sine = |d: &Vector3<f64>| t.cross(d).norm() / (t.norm() * d.norm());
            t.norm() > 20.0 && p.norm() > 50.0 && sine(p) > 0.05 && sine(&(p - t)) > 0.05
        })
        .prop_map(|(t, p)| (Point::from_mm(t), p))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn rays_that_meet_give_their_point((t, p) in scene()) {
        let (u, v) = (towards(p), towards(p - t.mm()));
        for method in [pseudo_intersection, midpoint] {
            let found = method(&u, &v, &t).unwrap();
            prop_assert!((found.point.mm() - p).norm() < 1e-9 * p.norm());
            prop_assert!((found.left_range.mm() - p.norm()).abs() < 1e-9 * p.norm());
            prop_assert!((found.right_range.mm() - (p - t.mm()).norm()).abs() < 1e-9 * p.norm());
            prop_assert!(found.skew.rad() < 1e-12);
            let cosine = u.vector().dot(&v.vector());
            prop_assert!((found.parallax.rad().cos() - cosine).abs() < 1e-9);
        }
    }

    #[test]
    fn the_pseudo_intersection_lies_between_the_epipolar_planes((t, p) in scene(), noise in vector(0.02)) {
        let (u, v) = (towards(p), towards((p - t.mm()).normalize() + noise));
        if let Ok(found) = pseudo_intersection(&u, &v, &t) {
            let [from_left, from_right] = [u, v].map(|ray| {
                let toward = towards(found.point.mm());
                dihedral(&ray, &toward, &t).unwrap().abs()
            });
            prop_assert!((from_left + from_right - found.skew).rad().abs() < 1e-9);
        }
    }

    #[test]
    fn the_point_does_not_depend_on_which_camera_is_left((t, p) in scene(), noise in vector(0.02)) {
        let (u, v) = (towards(p), towards((p - t.mm()).normalize() + noise));
        let mirrored = Point::from_mm(-t.mm());
        match (pseudo_intersection(&u, &v, &t), pseudo_intersection(&v, &u, &mirrored)) {
            (Ok(a), Ok(b)) => {
                let distance = a.point.mm() - (b.point.mm() + t.mm());
                // Both ranges are errors of about 1e-16 rad times range squared over baseline.
                prop_assert!(distance.norm() < 1e-6 * a.left_range.mm().max(1.0), "{:?} {:?}", a, b);
                prop_assert!((a.skew - b.skew).rad().abs() < 1e-12);
                prop_assert!((a.parallax - b.parallax).rad().abs() < 1e-9);
            }
            (a, b) => prop_assert_eq!(a.is_ok(), b.is_ok()),
        }
    }

    #[test]
    fn turning_and_scaling_the_scene_turns_and_scales_the_point(
        (t, p) in scene(), noise in vector(0.01), turn in vector(2.0), scale in 1e-6..1e6f64,
    ) {
        let (u, v) = (p.normalize(), (p - t.mm()).normalize() + noise);
        let turn = UnitQuaternion::from_scaled_axis(turn);
        let still = pseudo_intersection(&towards(u), &towards(v), &t);
        let moved = pseudo_intersection(&towards(turn * u), &towards(turn * v), &Point::from_mm(turn * t.mm() * scale));
        if let (Ok(still), Ok(moved)) = (still, moved) {
            let expected = turn * still.point.mm() * scale;
            prop_assert!((moved.point.mm() - expected).norm() < 1e-6 * expected.norm());
        }
    }

    #[test]
    fn covariance_is_symmetric_positive_and_grows_with_noise((t, p) in scene(), sigma in 1e-6..1e-2f64) {
        let p = Point::from_mm(p);
        let c = covariance(&p, &t, Angle::from_rad(sigma)).unwrap();
        let doubled = covariance(&p, &t, Angle::from_rad(2.0 * sigma)).unwrap();
        prop_assert!((doubled - 4.0 * c).amax() <= 1e-9 * c.amax());
        prop_assert!((c - c.transpose()).amax() <= 1e-12 * c.amax());
        prop_assert!(c.symmetric_eigenvalues().min() > 0.0);
    }

    #[test]
    fn no_input_makes_a_point_that_is_not_finite(
        u in vector(1.0), v in vector(1.0), t in [any::<f64>(), any::<f64>(), any::<f64>()],
    ) {
        if let (Some(u), Some(v)) = (UnitRay::new(u), UnitRay::new(v))
            && let Ok(found) = pseudo_intersection(&u, &v, &Point::from_mm(Vector3::from(t)))
        {
            prop_assert!(found.point.mm().iter().all(|c| c.is_finite()));
            prop_assert!(found.left_range.mm() > 0.0 && found.right_range.mm() > 0.0);
        }
    }
}
