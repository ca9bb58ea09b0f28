//! Zones in the plane against published and computed figures, and against a count of azimuths.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod paper;

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;
use vergence_vision::{
    Angle, Coverage, Length, PAPER_FIELD, PlanarCamera, ZoneMap, Zones, ZonesError, symmetric_pair, zones_exact,
};

/// Horizontal field of the lenses in degrees.
const FIELD: f64 = PAPER_FIELD.deg();

/// Half a unit of the second printed digit.
const PRINTED: f64 = 0.005 + 1e-9;

/// Baseline and radius in millimetres, separation and field in degrees.
#[derive(Clone, Copy, Debug)]
struct Rig {
    baseline: f64,
    separation: f64,
    radius: f64,
    field: f64,
}

const fn rig(baseline: f64, separation: f64, radius: f64) -> Rig {
    Rig { baseline, separation, radius, field: FIELD }
}

fn degrees(zones: Zones) -> [f64; 3] {
    [zones.stereo.deg(), zones.mono.deg(), zones.blind.deg()]
}

fn exact(r: Rig) -> [f64; 3] {
    let pair = symmetric_pair(Length::from_mm(r.baseline), Angle::from_deg(r.separation), Angle::from_deg(r.field));
    degrees(zones_exact(pair, Length::from_mm(r.radius)).unwrap().zones)
}

fn assert_near(found: [f64; 3], expected: [f64; 3], tolerance: f64, what: impl std::fmt::Debug) {
    let near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= tolerance);
    assert!(near, "{what:?}: {found:?}, expected {expected:?}");
}

/// The largest separation at which the stereo zone is still limited by the outer edges, where it is widest.
#[test]
fn the_stereo_zone_is_widest_at_the_branch_switch() {
    for (baseline, radius, switch) in [(145.0, 350.0, 3.29), (100.0, 350.0, 2.27), (145.0, 3000.0, 0.38)] {
        let stereo = |separation| exact(rig(baseline, separation, radius))[0];
        let (mut low, mut high) = (-10.0, 20.0);
        while high - low > 1e-6 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if stereo(a) < stereo(b) { low = a } else { high = b }
        }
        assert!((low - switch).abs() <= PRINTED, "{baseline} {radius}: {low}");
    }
}

#[test]
fn far_away_stereo_and_total_add_up_to_both_fields() {
    for separation in [-40.0, 0.0, 60.0, 120.0] {
        let [stereo, mono, _] = exact(rig(145.0, separation, 1e9));
        assert!((2.0 * stereo + mono - 2.0 * FIELD).abs() < 1e-4, "{separation}");
    }
}

/// Two 300° cameras looking apart overlap in front and behind: 240° in all, in two arcs.
#[test]
fn rear_overlap_counts_as_stereo() {
    let map = zones_exact(
        symmetric_pair(Length::from_mm(0.0), Angle::from_deg(180.0), Angle::from_deg(300.0)),
        Length::from_mm(100.0),
    )
    .unwrap();
    assert_near(degrees(map.zones), [240.0, 120.0, 0.0], 1e-9, &map);
    assert_eq!(map.arcs.iter().filter(|arc| arc.coverage == Coverage::Stereo).count(), 2);
}

#[test]
fn cameras_that_see_all_or_nothing_have_whole_zones() {
    let both = |field| rig_zones(0.0, 0.0, field);
    assert_near(degrees(both(360.0)), [360.0, 0.0, 0.0], 1e-9, "all");
    assert_near(degrees(both(0.0)), [0.0, 0.0, 360.0], 1e-9, "nothing");
}

fn rig_zones(baseline: f64, separation: f64, field: f64) -> Zones {
    let pair = symmetric_pair(Length::from_mm(baseline), Angle::from_deg(separation), Angle::from_deg(field));
    zones_exact(pair, Length::from_mm(350.0)).unwrap().zones
}

#[test]
fn rigs_without_zones_are_refused() {
    let good = symmetric_pair(Length::from_mm(145.0), Angle::from_deg(0.0), Angle::from_deg(FIELD));
    let with = |camera: PlanarCamera| zones_exact([good[0], camera], Length::from_mm(350.0)).unwrap_err();
    assert_eq!(with(PlanarCamera { centre_mm: [0.0, 350.0], ..good[1] }), ZonesError::OutsideCircle);
    assert_eq!(with(PlanarCamera { centre_mm: [f64::NAN, 0.0], ..good[1] }), ZonesError::NotFinite);
    assert_eq!(with(PlanarCamera { axis: Angle::from_rad(f64::INFINITY), ..good[1] }), ZonesError::NotFinite);
    assert_eq!(with(PlanarCamera { half_field: Angle::from_deg(181.0), ..good[1] }), ZonesError::HalfField);
    assert_eq!(with(PlanarCamera { half_field: Angle::from_deg(-1.0), ..good[1] }), ZonesError::HalfField);
    for radius in [0.0, -350.0] {
        assert_eq!(zones_exact(good, Length::from_mm(radius)), Err(ZonesError::OutsideCircle));
    }
    assert_eq!(zones_exact(good, Length::from_mm(f64::NAN)), Err(ZonesError::NotFinite));
}

/// Whether the camera sees the point of the circle at `azimuth`, from its definition.
fn sees(camera: &PlanarCamera, azimuth: f64, radius: f64) -> bool {
    let [x, y] = camera.centre_mm;
    let (dx, dy) = (radius * azimuth.sin() - x, radius * azimuth.cos() - y);
    let off_axis = (dx.atan2(dy) - camera.axis.rad() + PI).rem_euclid(TAU) - PI;
    off_axis.abs() <= camera.half_field.rad()
}

fn camera() -> impl Strategy<Value = PlanarCamera> {
    ([-240.0..240.0f64, -240.0..240.0f64], -360.0..360.0f64, 1.0..179.0f64).prop_map(|(centre_mm, axis, half)| {
        PlanarCamera { centre_mm, axis: Angle::from_deg(axis), half_field: Angle::from_deg(half) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn exact_zones_are_those_found_by_counting_azimuths(cameras in [camera(), camera()]) {
        const SAMPLES: u32 = 20_000;
        let step = TAU / f64::from(SAMPLES);
        let ZoneMap { zones, arcs } = zones_exact(cameras, Length::from_mm(350.0)).unwrap();
        let mut counted = [0.0; 3];
        for i in 0..SAMPLES {
            let azimuth = (f64::from(i) + 0.5) * step;
            counted[cameras.iter().filter(|camera| sees(camera, azimuth, 350.0)).count()] += step;
        }
        // Each of the four ends is found to half a step.
        for (found, counted) in [zones.blind, zones.mono, zones.stereo].into_iter().zip(counted) {
            prop_assert!((found.rad() - counted).abs() <= 2.0 * step + 1e-9, "{:?} {:?}", zones, counted);
        }
        for arc in &arcs {
            let middle = 0.5 * (arc.start + arc.end).rad();
            let count = cameras.iter().filter(|camera| sees(camera, middle, 350.0)).count();
            prop_assert_eq!(arc.coverage, [Coverage::Blind, Coverage::Mono, Coverage::Stereo][count]);
        }
    }

    #[test]
    fn arcs_go_once_around(cameras in [camera(), camera()]) {
        let ZoneMap { zones, arcs } = zones_exact(cameras, Length::from_mm(350.0)).unwrap();
        prop_assert!(((zones.stereo + zones.mono + zones.blind).rad() - TAU).abs() < 1e-11);
        for neighbours in arcs.windows(2) {
            prop_assert!((neighbours[1].start - neighbours[0].end).rad().abs() < 1e-11);
        }
        prop_assert!(((arcs[arcs.len() - 1].end - arcs[0].start).rad() - TAU).abs() < 1e-11);
    }

    #[test]
    fn turning_the_rig_turns_the_arcs(cameras in [camera(), camera()], turn in -400.0..400.0f64) {
        let (sin, cos) = turn.to_radians().sin_cos();
        let turned = cameras.map(|c| PlanarCamera {
            centre_mm: [c.centre_mm[0] * cos + c.centre_mm[1] * sin, c.centre_mm[1] * cos - c.centre_mm[0] * sin],
            axis: c.axis + Angle::from_deg(turn),
            ..c
        });
        let [still, turned] = [cameras, turned].map(|c| zones_exact(c, Length::from_mm(350.0)).unwrap().zones);
        assert_near(degrees(still), degrees(turned), 1e-9, "turned");
    }
}
