//! Wrong poses: they are detected from the matches, and the matches are still found.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use common::Pair;
use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};
use vergence_alignment::{PoseDrift, pose_drift};
use vergence_matching::{GuidedMatcher, ImagePair, Match, Matcher};
use vergence_vision::{Angle, Left, Right, StereoPair, Transform};

/// The pose drift with the pose turned by `off` and a stated sigma of 0.02° and 0.1 mm, and the number of matches.
fn drift(pair: &Pair, off: Vector3<f64>) -> (PoseDrift, usize) {
    let images = pair.images();
    let truth = images.left_from_right;
    let believed: Transform<Left, Right> =
        Transform::new(UnitQuaternion::from_scaled_axis(-off) * truth.rotation(), truth.origin().mm());
    let images = ImagePair { left_from_right: believed, pose_sigma: Angle::from_deg(0.15), ..images };
    let found = GuidedMatcher::default().find(&images).unwrap().pairs;
    let pixels: Vec<_> = found.iter().map(Match::measured).collect();
    let rig = StereoPair { left: &pair.camera, right: &pair.camera, left_from_right: believed };
    let (turn, shift) = (0.02f64.to_radians().powi(2), 0.1f64.powi(2));
    let stated = Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, shift, shift, shift));
    (pose_drift(&pixels, &rig, &stated).unwrap(), found.len())
}

#[test]
fn encoders_and_images_disagree_by_three_tenths_of_a_degree() {
    let pair = Pair::new(640, Angle::from_deg(60.0));
    let (right, matches) = drift(&pair, Vector3::zeros());
    assert!(!right.is_significant(), "{} {}", right.chi_squared, right.angle);
    for axis in [Vector3::x(), Vector3::z()] {
        let off = axis * 0.3f64.to_radians();
        let (found, still) = drift(&pair, off);
        assert!(found.is_significant(), "{axis:?}: {} {}", found.chi_squared, found.angle);
        let error = (found.correction.fixed_rows::<3>(0) - off).norm().to_degrees();
        assert!(error < 0.06, "{axis:?}: the turn is found {error:.3}° off");
        assert!(still * 10 > matches * 7, "{still} of {matches} matches are left");
    }
}

/// An error far beyond that of encoders: a rig assembled wrongly, or the file of another rig.
#[test]
fn a_pose_wrong_by_five_degrees_is_noticed_and_most_matches_are_still_found() {
    for separation in [60.0, 120.0] {
        let pair = Pair::new(640, Angle::from_deg(separation));
        let (_, matches) = drift(&pair, Vector3::zeros());
        let off = Vector3::new(1.0, -1.0, 1.0).normalize() * 5f64.to_radians();
        let (found, still) = drift(&pair, off);
        println!("{separation}°: {still} of {matches} matches, the pose is said to be {:.2}° off", found.angle.deg());
        assert!(still * 10 > matches * 6, "{still} of {matches} matches are left");
        assert!(found.is_significant());
        let error = (found.correction.fixed_rows::<3>(0) - off).norm().to_degrees();
        assert!(error < 0.15, "the turn is found {error:.3}° off");
    }
}
