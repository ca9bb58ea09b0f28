//! Tests of `src/match_sigma.rs`, of what is private there.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

use nalgebra::UnitQuaternion;
use proptest::prelude::*;

use super::*;
use crate::{ImageSize, KannalaBrandt, Pixel, Point, PointUncertainty, Transform, range_sigma};

fn lens() -> KannalaBrandt {
    let size = ImageSize { width: 1280, height: 1280 };
    let centre = Pixel { u: 639.5, v: 639.5 };
    KannalaBrandt::new([374.0, -3.0, 0.5, 0.0, 0.0], 1.02, centre, Angle::from_deg(98.0), size).unwrap()
}

fn left_from_right(separation: f64) -> Transform<Left, Right> {
    let half = separation.to_radians() / 2.0;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.0 * half);
    Transform::new(turn, Vector3::new(145.0 * half.cos(), 3.0, -145.0 * half.sin()))
}

proptest! {
    #[test]
    fn rays_are_off_by_the_stated_turns(
        separation in 0.0..120.0_f64, azimuth in -60.0..60.0_f64, elevation in -70.0..70.0_f64, range in 300.0..5000.0_f64,
        along in 1e-4..1e-3_f64, ratio in 0.5..1.5_f64,
    ) {
        let (lens, left_from_right) = (lens(), left_from_right(separation));
        let pair = StereoPair { left: &lens, right: &lens, left_from_right };
        let azimuth = (azimuth + separation / 2.0).to_radians();
        let (sine, cosine) = elevation.to_radians().sin_cos();
        let point = Point::<Left>::from_mm(Vector3::new(azimuth.sin() * cosine, sine, azimuth.cos() * cosine) * range);
        let (left, right) = (point.direction().unwrap(), (left_from_right.inverse() * point).direction().unwrap());
        let turns = [along, along * ratio].map(Angle::from_rad);
        let sigma = MatchSigma::of_turns(turns, &left, &right, &pair).unwrap();
        let baseline = left_from_right.origin().mm();
        let in_right = left_from_right.rotation().inverse() * baseline;
        let mut found = [0.0; 2];
        for (ray, baseline, by_pixel) in [
            (left.vector(), baseline, lens.ray_by_pixel(&left)), (right.vector(), in_right, lens.ray_by_pixel(&right)),
        ] {
            let root = sigma.of_ray(&by_pixel, &ray, &baseline);
            let normal = baseline.cross(&ray).normalize();
            found[0] += (normal.cross(&ray).transpose() * root).norm_squared();
            found[1] += (normal.transpose() * root).norm_squared();
        }
        prop_assert!((found[1].sqrt() / (along * ratio) - 1.0).abs() < 1e-9, "{found:?}");
        prop_assert!((found[0].sqrt() / along - 1.0).abs() < 1e-9, "{found:?}");
        // The error along the curve alone makes the range uncertain.
        let range_sigma = |sigma: MatchSigma| {
            range_sigma(&PointUncertainty::of(&point, &pair, sigma).unwrap().from_pixels, &point).unwrap().mm()
        };
        let parallax = left.vector().cross(&(left_from_right * right).vector()).norm();
        let farthest = range.max((point.mm() - baseline).norm());
        prop_assert!(range_sigma(sigma) <= 1.001 * along * farthest / parallax, "{}", range_sigma(sigma));
    }
}

#[test]
fn one_number_stands_for_both_directions() {
    let (lens, left_from_right) = (lens(), left_from_right(60.0));
    let pair = StereoPair { left: &lens, right: &lens, left_from_right };
    let point = Point::<Left>::from_mm(Vector3::new(300.0, 200.0, 500.0));
    let of = |sigma: MatchSigma| PointUncertainty::of(&point, &pair, sigma).unwrap().from_pixels;
    let nearly = MatchSigma { along: 0.3, across: 0.3 + 1e-12 };
    assert!((of(0.3.into()) - of(nearly)).norm() < 1e-9 * of(nearly).norm());
    assert!(of(MatchSigma { along: 0.3, across: 0.6 }).trace() > of(nearly).trace());
}
