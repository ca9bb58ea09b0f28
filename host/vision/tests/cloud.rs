//! Clouds from matches: every match is counted, exact matches return their points, and each gate has its reason.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Cloud, DropReason, Gates, ImageSize, KannalaBrandt, Left, Length, Pixel, PixelPair, Point, Right,
    SharedCovariance, StereoPair, Transform, cloud,
};

const SIZE: ImageSize = ImageSize { width: 2080, height: 2080 };

/// 0.5 px is 0.9 mrad for each ray.
fn gates() -> Gates {
    Gates {
        epipolar_sigmas: 4.0,
        min_parallax: Angle::from_rad(5e-3),
        max_range: None,
        pixel_sigma: 0.5,
        max_relative_sigma: 0.2,
        ..Gates::default()
    }
}

fn lens(k1: f64) -> KannalaBrandt {
    let k = [560.0, 560.0 * k1, 0.0, 0.0, 0.0];
    KannalaBrandt::new(k, 1.0, Pixel { u: 1039.5, v: 1039.5 }, Angle::from_deg(98.0), SIZE).unwrap()
}

/// A baseline of 145 mm with the axes `separation` degrees apart.
fn left_from_right(separation: f64) -> Transform<Left, Right> {
    let half = separation.to_radians() / 2.0;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.0 * half);
    Transform::new(turned, Vector3::new(145.0 * half.cos(), 0.0, -145.0 * half.sin()))
}

fn see(rig: &StereoPair<'_>, point: &Point<Left>) -> Option<PixelPair> {
    let left = rig.left.project_point(point).ok()?;
    let right = rig.right.project_point(&(rig.left_from_right.inverse() * *point)).ok()?;
    Some(PixelPair { left, right })
}

fn at(x: f64, y: f64, z: f64) -> Point<Left> {
    Point::from_mm(Vector3::new(x, y, z))
}

fn accounted(cloud: &Cloud) -> usize {
    cloud.points.len() + cloud.dropped.values().sum::<usize>()
}

/// The drop reason of one match of parallel cameras; `None` for a point.
fn fate(pair: PixelPair, gates: &Gates) -> Option<DropReason> {
    let (left, right) = (lens(0.0), lens(0.01));
    let rig = StereoPair { left: &left, right: &right, left_from_right: left_from_right(0.0) };
    let cloud = cloud(&[pair], &rig, gates);
    assert_eq!(accounted(&cloud), 1);
    cloud.dropped.keys().next().copied()
}

fn fate_of(point: Point<Left>, gates: &Gates) -> Option<DropReason> {
    let (left, right) = (lens(0.0), lens(0.01));
    let rig = StereoPair { left: &left, right: &right, left_from_right: left_from_right(0.0) };
    fate(see(&rig, &point).unwrap(), gates)
}

#[test]
fn each_gate_drops_for_its_own_reason() {
    let good = at(72.5, 10.0, 350.0);
    let outside = Pixel { u: 1e5, v: 0.0 };
    let (left, right) = (lens(0.0), lens(0.01));
    let rig = StereoPair { left: &left, right: &right, left_from_right: left_from_right(0.0) };
    let seen = see(&rig, &good).unwrap();
    assert_eq!(fate(seen, &gates()), None);
    assert_eq!(fate(PixelPair { left: outside, ..seen }, &gates()), Some(DropReason::OutsideLeftField));
    assert_eq!(fate(PixelPair { right: outside, ..seen }, &gates()), Some(DropReason::OutsideRightField));
    let raised = Pixel { v: seen.right.v + 10.0, ..seen.right };
    assert_eq!(fate(PixelPair { right: raised, ..seen }, &gates()), Some(DropReason::Epipolar));
    let crossed = PixelPair { left: Pixel { u: 900.0, v: 1039.5 }, right: Pixel { u: 1200.0, v: 1039.5 } };
    assert_eq!(fate(crossed, &gates()), Some(DropReason::Diverging));
    assert_eq!(fate_of(at(0.0, 0.0, 1e5), &gates()), Some(DropReason::Parallax));
    let near = Gates { max_range: Some(Length::from_mm(300.0)), ..gates() };
    assert_eq!(fate_of(good, &near), Some(DropReason::TooFar));
    let strict = Gates { max_relative_sigma: 1e-3, ..gates() };
    assert_eq!(fate_of(good, &strict), Some(DropReason::Uncertain));
    assert_eq!(fate_of(at(300.0, 0.0, 0.0), &gates()), Some(DropReason::OnBaseline));
}

#[test]
fn limits_that_are_not_numbers_drop_every_match() {
    let good = at(72.5, 10.0, 350.0);
    let nan = Angle::from_rad(f64::NAN);
    for (gates, reason) in [
        (Gates { epipolar_sigmas: f64::NAN, ..gates() }, DropReason::Epipolar),
        (Gates { min_parallax: nan, ..gates() }, DropReason::Parallax),
        (Gates { max_range: Some(Length::from_mm(f64::NAN)), ..gates() }, DropReason::TooFar),
        (Gates { pixel_sigma: f64::NAN, ..gates() }, DropReason::Uncertain),
        (Gates { max_relative_sigma: f64::NAN, ..gates() }, DropReason::Uncertain),
    ] {
        assert_eq!(fate_of(good, &gates), Some(reason));
    }
}

#[test]
fn reasons_have_stable_names() {
    let names = [
        (DropReason::OutsideLeftField, "outside_left_field"),
        (DropReason::OutsideRightField, "outside_right_field"),
        (DropReason::Epipolar, "epipolar"),
        (DropReason::OnBaseline, "on_baseline"),
        (DropReason::Diverging, "diverging"),
        (DropReason::Parallax, "parallax"),
        (DropReason::TooFar, "too_far"),
        (DropReason::Uncertain, "uncertain"),
        (DropReason::NoPoint, "no_point"),
    ];
    assert!(names.is_sorted());
    for (reason, name) in names {
        assert_eq!(reason.to_string(), name);
    }
}

/// σ = 0.56 px at 560 px/rad is 1 mrad along the radius and, across it, 1 mrad times sin θ / θ: 0.99288 at the angle of
/// 11.70°. On the midline 350 mm ahead that makes 1.246 mm across the baseline, and with C diagonal there, the range
/// variance is (0.2581² · 72.5² + 1.2460² · 350²) / (72.5² + 350²). The point lies in the epipolar plane of both axes,
/// so that only the radial noise counts.
#[test]
fn the_range_sigma_follows_from_the_pixel_sigma() {
    let lens = lens(0.0);
    let rig = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(0.0) };
    let gates = Gates { pixel_sigma: 0.56, ..gates() };
    let cloud = cloud(&[see(&rig, &at(72.5, 0.0, 350.0)).unwrap()], &rig, &gates);
    assert!((cloud.points[0].sigma_range.mm() - 1.2212).abs() < 2e-4, "{:?}", cloud.points);
}

/// A larger covariance of the pose widens the gate and the covariance of the point.
#[test]
fn uncertainty_of_the_pose_widens_gate_and_covariance() {
    let lens = lens(0.0);
    let rig = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(0.0) };
    let seen = see(&rig, &at(72.5, 0.0, 350.0)).unwrap();
    let raised = PixelPair { right: Pixel { v: seen.right.v + 4.0, ..seen.right }, ..seen };
    assert_eq!(fate(raised, &gates()), Some(DropReason::Epipolar));
    let turn = 0.005f64.powi(2);
    let pose = nalgebra::Matrix6::from_diagonal(&[turn, turn, turn, 0.0, 0.0, 0.0].into());
    let unsure = Gates { shared: SharedCovariance::exact().with_pose(&pose), ..gates() };
    assert_eq!(fate(raised, &unsure), None);
    let sigma = |gates: &Gates| cloud(&[seen], &rig, gates).points[0].sigma_range.mm();
    // A turn of 5 mrad about y moves the point on the midline by λ² / B · 5 mrad = 4.4 mm.
    assert!((sigma(&unsure).hypot(-sigma(&gates())) > 4.0) && sigma(&unsure) > 4.0, "{}", sigma(&unsure));
}

fn pixel() -> impl Strategy<Value = Pixel> {
    let coordinate = prop_oneof![9 => -200.0..2300.0f64, 1 => any::<f64>()];
    [coordinate.clone(), coordinate].prop_map(|[u, v]| Pixel { u, v })
}

fn wide_open() -> Gates {
    Gates {
        epipolar_sigmas: f64::INFINITY,
        min_parallax: Angle::default(),
        max_relative_sigma: f64::INFINITY,
        ..gates()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn every_pair_becomes_a_point_or_has_a_reason(
        pixels in prop::collection::vec([pixel(), pixel()], 0..60),
        separation in -60.0..160.0f64,
        open in any::<bool>(),
    ) {
        let (left, right) = (lens(0.01), lens(-0.03));
        let rig = StereoPair { left: &left, right: &right, left_from_right: left_from_right(separation) };
        let pairs: Vec<_> = pixels.into_iter().map(|[left, right]| PixelPair { left, right }).collect();
        let gates = if open { wide_open() } else { gates() };
        let made = cloud(&pairs, &rig, &gates);
        prop_assert_eq!(accounted(&made), pairs.len());
        prop_assert!(made.points.iter().all(|point| point.pixels == pairs[point.pair_index]));
        prop_assert!(made.points.is_sorted_by(|a, b| a.pair_index < b.pair_index));
        prop_assert!(made.dropped.values().all(|&count| count > 0));
        for point in &made.points {
            prop_assert!(point.residual.abs() <= point.residual_sigma * gates.epipolar_sigmas);
            prop_assert!(point.sigma_range.mm() <= gates.max_relative_sigma * point.point.mm().norm());
        }
        prop_assert_eq!(cloud(&pairs, &rig, &gates), made);
    }

    #[test]
    fn exact_pairs_return_their_points(
        places in prop::collection::vec([-400.0..400.0f64, -400.0..400.0, -200.0..900.0], 1..40),
        separation in -60.0..120.0f64,
    ) {
        let (left, right) = (lens(0.01), lens(-0.03));
        let rig = StereoPair { left: &left, right: &right, left_from_right: left_from_right(separation) };
        let (points, pairs): (Vec<_>, Vec<_>) = places
            .into_iter()
            .map(|[x, y, z]| at(x, y, z))
            .filter_map(|point| see(&rig, &point).map(|pair| (point, pair)))
            .unzip();
        let made = cloud(&pairs, &rig, &gates());
        prop_assert_eq!(accounted(&made), pairs.len());
        for found in &made.points {
            let expected = points[found.pair_index].mm();
            prop_assert!((found.point.mm() - expected).norm() < 1e-8 * expected.norm());
            prop_assert!(found.residual.abs().rad() < 1e-11);
        }
        // Exact matches are dropped only near the baseline or far away.
        let explained = [DropReason::OnBaseline, DropReason::Parallax, DropReason::Uncertain];
        prop_assert!(made.dropped.keys().all(|reason| explained.contains(reason)), "{:?}", made.dropped);
    }
}
