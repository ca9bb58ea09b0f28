//! Laws of the rotation and translation between two clouds.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_calibration::{ArunError, fit_rotation_translation};
use vergence_vision::{Left, Point, Right, Transform};

type Pairs = Vec<(Point<Left>, Point<Right>)>;

fn vector(half: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-half..half).prop_map(Vector3::from)
}

fn transform() -> impl Strategy<Value = Transform<Left, Right>> {
    (vector(1.8), vector(500.0)).prop_map(|(r, t)| Transform::new(UnitQuaternion::from_scaled_axis(r), t))
}

fn pairs(pose: &Transform<Left, Right>, cloud: &[Vector3<f64>]) -> Pairs {
    cloud.iter().map(|&p| (*pose * Point::from_mm(p), Point::from_mm(p))).collect()
}

fn squares(pose: &Transform<Left, Right>, pairs: &Pairs) -> f64 {
    pairs.iter().map(|(to, from)| (to.mm() - (*pose * *from).mm()).norm_squared()).sum()
}

proptest! {
    #[test]
    fn exact_clouds_give_the_exact_transform(pose in transform(), cloud in prop::collection::vec(vector(100.0), 4..20)) {
        let found = fit_rotation_translation(&pairs(&pose, &cloud)).unwrap();
        prop_assert!(found.rotation().angle_to(&pose.rotation()) < 1e-6);
        prop_assert!((found.origin().mm() - pose.origin().mm()).norm() < 1e-4);
    }

    /// A target is a plane: the third singular value is zero, the rotation still proper and exact.
    #[test]
    fn flat_clouds_give_the_exact_transform(pose in transform(), tilt in vector(1.5)) {
        let tilt = UnitQuaternion::from_scaled_axis(tilt);
        let cloud: Vec<_> = (0..54).map(|i| tilt * Vector3::new(f64::from(i % 9), f64::from(i / 9), 0.0) * 25.0).collect();
        let found = fit_rotation_translation(&pairs(&pose, &cloud)).unwrap();
        prop_assert!(found.rotation().angle_to(&pose.rotation()) < 1e-7);
        prop_assert!((found.rotation().to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
    }

    /// No small move of the result fits better.
    #[test]
    fn it_is_the_least_squares_solution(
        pose in transform(),
        cloud in prop::collection::vec((vector(100.0), vector(5.0)), 6..20),
        turn in vector(1e-3),
        shift in vector(0.1),
    ) {
        let noisy: Pairs = cloud
            .iter()
            .map(|(p, noise)| (Point::from_mm((pose * Point::<Right>::from_mm(*p)).mm() + noise), Point::from_mm(*p)))
            .collect();
        let found = fit_rotation_translation(&noisy).unwrap();
        let moved = Transform::new(UnitQuaternion::from_scaled_axis(turn) * found.rotation(), found.origin().mm() + shift);
        prop_assert!(squares(&found, &noisy) <= squares(&moved, &noisy) * (1.0 + 1e-12));
    }

    /// Swapping the clouds inverts the transform.
    #[test]
    fn swapping_the_clouds_inverts(pose in transform(), cloud in prop::collection::vec((vector(100.0), vector(3.0)), 6..20)) {
        let noisy: Pairs = cloud
            .iter()
            .map(|(p, noise)| (Point::from_mm((pose * Point::<Right>::from_mm(*p)).mm() + noise), Point::from_mm(*p)))
            .collect();
        let swapped: Vec<_> = noisy.iter().map(|(to, from)| (*from, *to)).collect();
        let there = fit_rotation_translation(&noisy).unwrap();
        let back = fit_rotation_translation(&swapped).unwrap();
        let both = there * back;
        prop_assert!(both.rotation().angle() < 1e-6 && both.origin().mm().norm() < 1e-3);
    }
}

/// The unconstrained optimum here is a reflection; the answer must be a rotation all the same.
#[test]
fn a_reflection_is_never_returned() {
    let cloud = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [-1.0, -1.0, -1.0]].map(Vector3::from);
    let mirrored: Pairs =
        cloud.iter().map(|p| (Point::from_mm(Vector3::new(-p.x, p.y, p.z)), Point::from_mm(*p))).collect();
    let found = fit_rotation_translation(&mirrored).unwrap();
    assert!((found.rotation().to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
    // The best rotation: checked against a search over many.
    let best = squares(&found, &mirrored);
    for i in 0..20_000u32 {
        let angle = |k: u32| f64::from(i.wrapping_mul(k) % 20_011) / 20_011.0 * 6.3 - 3.15;
        let rotation = UnitQuaternion::from_euler_angles(angle(7919), angle(104_729), angle(31));
        let to_centre = mirrored.iter().map(|(to, _)| to.mm()).sum::<Vector3<f64>>() / 4.0;
        let from_centre = mirrored.iter().map(|(_, from)| from.mm()).sum::<Vector3<f64>>() / 4.0;
        let origin = to_centre - rotation * from_centre;
        assert!(squares(&Transform::new(rotation, origin), &mirrored) >= best - 1e-9);
    }
}

#[test]
fn refusals_are_named() {
    let pose = Transform::new(UnitQuaternion::identity(), Vector3::zeros());
    let line: Vec<_> = (0..9).map(|i| Vector3::new(f64::from(i), 2.0 * f64::from(i), 1.0)).collect();
    assert_eq!(fit_rotation_translation(&pairs(&pose, &line[..2])), Err(ArunError::TooFewPoints(2)));
    assert_eq!(fit_rotation_translation(&pairs(&pose, &line)), Err(ArunError::Degenerate));
    assert_eq!(fit_rotation_translation(&pairs(&pose, &[Vector3::x(); 5])), Err(ArunError::Degenerate));
    let broken = [Vector3::x(), Vector3::y(), Vector3::new(0.0, f64::NAN, 1.0)];
    assert_eq!(fit_rotation_translation(&pairs(&pose, &broken)), Err(ArunError::NotFinite));
}
