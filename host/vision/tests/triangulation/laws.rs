//! Laws of triangulation over random scenes.

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{Angle, Left, Point, UnitRay, covariance, dihedral, midpoint, pseudo_intersection};

use super::towards;

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
