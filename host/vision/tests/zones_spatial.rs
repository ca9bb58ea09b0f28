//! Zones of real lenses in space: solid angles, circles, and masks of the body.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Base, BodyMask, Camera, ImageSize, KannalaBrandt, Length, Pixel, PlacedCamera, Point, SolidZones, Transform,
    ZonesError, circle_zones, paper_eq3_applies, solid_zones, symmetric_pair, zones_exact,
};

/// Pixels per radian of the equidistant lenses here.
const F: f64 = 500.0;

/// A lens whose image circle is `diagonal` degrees wide, on a sensor `wide` by `tall` degrees.
fn lens(wide: f64, tall: f64, diagonal: f64) -> KannalaBrandt {
    let pixels = |degrees: f64| (F * degrees.to_radians()).round() as u32;
    let size = ImageSize { width: pixels(wide), height: pixels(tall) };
    let centre = Pixel { u: f64::from(size.width) / 2.0 - 0.5, v: f64::from(size.height) / 2.0 - 0.5 };
    KannalaBrandt::new([F, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(diagonal / 2.0), size).unwrap()
}

fn cone(field: f64) -> KannalaBrandt {
    lens(2.0 * field, 2.0 * field, field)
}

/// Cameras on a level baseline, turned about the vertical as in a symmetric pair.
fn pair(lens: &KannalaBrandt, baseline: f64, separation: f64) -> [PlacedCamera<'_>; 2] {
    [-0.5, 0.5].map(|side| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), (side * separation).to_radians());
        PlacedCamera { lens, base_from_camera: Transform::new(turn, Vector3::x() * (side * baseline)), body: None }
    })
}

fn centre() -> Point<Base> {
    Point::from_mm(Vector3::zeros())
}

fn solid(cameras: &[PlacedCamera<'_>; 2], radius: f64) -> SolidZones {
    solid_zones(cameras, &centre(), Length::from_mm(radius), 100_000).unwrap()
}

/// Two cones of half-angle r with their axes d apart share, far away, in steradians (spherical geometry):
/// 2 [π - acos((cos d - cos² r) / sin² r) - 2 cos r acos((cos r - cos d cos r) / (sin d sin r))].
#[test]
fn far_cones_share_what_spherical_geometry_says() {
    let lens = cone(195.95);
    for (separation, expected) in [(20.0, 6.46361), (60.0, 5.08287), (120.0, 3.03347)] {
        let found = solid(&pair(&lens, 145.0, separation), 1e7);
        assert!((found.stereo_sr - expected).abs() < 2e-3, "{separation}: {found:?}");
        let sum = found.stereo_sr + found.mono_sr + found.blind_sr;
        assert!((sum - 4.0 * PI).abs() < 1e-9);
    }
}

/// Solid angles of the paper's modes with the lens's three stated fields, H 195.95°, V 159.8°, D 199.2°: a rectangle
/// cut by the image circle. From an independent count in numpy.
#[test]
fn solid_angles_of_the_modes() {
    let lens = lens(195.95, 159.8, 199.2);
    for (separation, radius, expected) in [
        (0.0, 350.0, [6.384, 0.696, 5.486]),
        (120.0, 350.0, [1.864, 7.488, 3.215]),
        (120.0, 3000.0, [2.523, 8.121, 1.923]),
        (60.0, 3000.0, [4.618, 4.040, 3.908]),
        (-40.0, 3000.0, [5.348, 2.830, 4.389]),
    ] {
        let found = solid(&pair(&lens, 145.0, separation), radius);
        for (found, expected) in [found.stereo_sr, found.mono_sr, found.blind_sr].iter().zip(expected) {
            assert!((found - expected).abs() < 0.012, "{separation} {radius}: {found} {expected}");
        }
    }
}

#[test]
fn a_body_in_the_image_hides_points_behind_it() {
    let lens = cone(180.0);
    let size = lens.size();
    // The left half of the left image is covered.
    let hidden = (0..size.width * size.height).map(|i| i % size.width < size.width / 2).collect();
    let body = BodyMask::new(size, hidden).unwrap();
    let [left, right] = pair(&lens, 1.0, 0.0);
    let cameras = [PlacedCamera { body: Some(&body), ..left }, right];
    let map = circle_zones(&cameras, &centre(), Length::from_mm(1e5)).unwrap();
    assert!((map.zones.stereo.deg() - 90.0).abs() < 0.1, "{:?}", map.zones);
    assert!((map.zones.mono.deg() - 90.0).abs() < 0.1, "{:?}", map.zones);
    assert!((solid(&cameras, 1e5).stereo_sr - PI).abs() < 0.01);
    assert_eq!(BodyMask::new(size, vec![false; 3]), None);
}

#[test]
fn rigs_without_zones_are_refused() {
    let lens = cone(180.0);
    let cameras = pair(&lens, 145.0, 0.0);
    assert_eq!(circle_zones(&cameras, &centre(), Length::from_mm(70.0)), Err(ZonesError::OutsideCircle));
    assert_eq!(circle_zones(&cameras, &centre(), Length::from_mm(f64::NAN)), Err(ZonesError::NotFinite));
    assert_eq!(solid_zones(&cameras, &centre(), Length::from_mm(350.0), 0), Err(ZonesError::NoDirections));
}

#[test]
fn crossed_cameras_see_each_others_back() {
    let wide = symmetric_pair(Length::from_mm(20.0), Angle::from_deg(170.0), Angle::from_deg(240.0));
    let map = zones_exact(wide, Length::from_mm(3000.0)).unwrap();
    // Far away each covers 240°, their middles 170° apart: 70° in front and 50° behind.
    assert!((map.rear_overlap().deg() - 50.0).abs() < 1.0, "{}", map.rear_overlap());
    assert!((map.zones.stereo.deg() - 120.0).abs() < 1.5);
}

#[test]
fn the_equation_applies_in_its_domain_only() {
    let applies = |separation: f64, baseline: f64, radius: f64| {
        let (field, separation) = (Angle::from_deg(195.95), Angle::from_deg(separation));
        paper_eq3_applies(field, separation, Length::from_mm(baseline), Length::from_mm(radius))
    };
    assert!(applies(120.0, 145.0, 350.0));
    assert!(applies(60.0, 145.0, 3000.0));
    assert!(!applies(0.0, 145.0, 350.0), "parallel axes");
    assert!(!applies(-40.0, 145.0, 3000.0), "crossed axes");
    assert!(!applies(190.0, 145.0, 350.0), "the inner edges cross outside the circle");
    assert!(!applies(196.0, 145.0, 350.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// In the plane, the interval formula and the search for changes are two ways to the same arcs.
    #[test]
    fn in_the_plane_both_routines_agree(
        baseline in 10.0..400.0f64, separation in -60.0..170.0f64, field in 100.0..220.0f64, radius in 250.0..4000.0f64,
    ) {
        let lens = cone(field);
        let found = circle_zones(&pair(&lens, baseline, separation), &centre(), Length::from_mm(radius)).unwrap();
        let exact = zones_exact(
            symmetric_pair(Length::from_mm(baseline), Angle::from_deg(separation), Angle::from_deg(field)),
            Length::from_mm(radius),
        ).unwrap();
        for (a, b) in [
            (found.zones.stereo, exact.zones.stereo),
            (found.zones.mono, exact.zones.mono),
            (found.zones.blind, exact.zones.blind),
        ] {
            // Arcs narrower than the step may be missed.
            prop_assert!((a - b).abs().deg() < 0.26, "{:?} {:?}", found.zones, exact.zones);
        }
    }

    /// Turning the whole rig about the vertical turns the arcs and changes no zone; tilting does.
    #[test]
    fn zones_do_not_depend_on_where_forward_is(turn in -180.0..180.0f64) {
        let lens = cone(195.95);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn.to_radians());
        let turned: Transform<Base, Base> = Transform::new(turn, Vector3::zeros());
        let cameras = pair(&lens, 145.0, 100.0);
        let moved = cameras.map(|camera| {
            let place: Transform<Base, Camera> = turned * camera.base_from_camera;
            PlacedCamera { base_from_camera: place, ..camera }
        });
        let radius = Length::from_mm(350.0);
        let before = circle_zones(&cameras, &centre(), radius).unwrap().zones;
        let after = circle_zones(&moved, &centre(), radius).unwrap().zones;
        prop_assert!((before.stereo - after.stereo).abs().deg() < 1e-6);
        prop_assert!((before.blind - after.blind).abs().deg() < 1e-6);
    }
}
