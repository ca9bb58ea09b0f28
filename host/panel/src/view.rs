//! Where the cameras are, which directions they see, and how well depth would be known there.

use serde_json::{Value, json};
use vergence_pipeline::{RigView, ZONE_RADIUS};
use vergence_rig::linkage::Corners;
use vergence_rig::{DepthField, Rig, RigPose, closure_in_words, rounded, zones_json};
use vergence_vision::{Angle, Coverage, PlacedCamera, Point, zones_exact};

use crate::message::packed;
use crate::streams::Outgoing;

/// Cells of the map around the whole circle of azimuths, from -180 to 180 degrees.
pub const SPHERE_COLUMNS: usize = 72;
/// Cells of the map from the zenith to the nadir.
pub const SPHERE_ROWS: usize = 36;
/// Standard deviation of matched positions for which errors are predicted, in pixels: that of `vergence plan --goal`.
pub const PIXEL_SIGMA: f64 = 0.1;

/// The rig from above with its axes at `values` (millimetres or radians). Places are in millimetres right and forward of the middle
/// between both cameras, angles in degrees to the right of forward.
#[must_use]
pub fn view_json(rig: &Rig, values: &[f64]) -> Value {
    let pose = rig.pose_read_at(values);
    let view = RigView::new(rig, &pose, [None, None]);
    let planar = view.from_above();
    let cameras = planar.map(|camera| {
        json!({
            "place": camera.centre_mm.map(rounded),
            "axis_deg": rounded(camera.axis.deg()),
            "half_field_deg": rounded(camera.half_field.deg()),
        })
    });
    let zones = zones_exact(planar, ZONE_RADIUS).ok();
    let arcs = zones.iter().flat_map(|map| &map.arcs).map(|arc| {
        let seen_by = match arc.coverage {
            Coverage::Blind => 0,
            Coverage::Mono => 1,
            Coverage::Stereo => 2,
        };
        json!([rounded(arc.start.deg()), rounded(arc.end.deg()), seen_by])
    });
    json!({
        "kind": "view",
        "cameras": cameras,
        "radius_mm": ZONE_RADIUS.mm(),
        "zones_deg": zones.as_ref().map(|map| zones_json(&map.zones)),
        "arcs": arcs.collect::<Vec<_>>(),
        "trunk": trunk_corners(rig, values, &view),
        "closure": closure_in_words(&pose),
        "extrapolations": rig.extrapolations(&pose.axes),
        "rotation_sigma_deg": rounded(pose.rotation_sigma.deg()),
        "translation_sigma_mm": rounded(pose.translation_sigma.mm()),
    })
}

/// The corners A to F of the trunk from above; its right half is foreshortened by the folds.
fn trunk_corners(rig: &Rig, values: &[f64], view: &RigView<'_>) -> Option<Vec<[f64; 2]>> {
    let trunk = rig.trunk.as_deref()?;
    let corners: Corners = trunk.shape(values);
    let [.., rear, front] = trunk.driven(values);
    let fold = 0.5 * (rear + front);
    let middle = view.middle.mm();
    let places = trunk.flat().links.places(&corners);
    let seen = places.iter().enumerate().map(|(corner, place)| {
        // D, E and F are of the right half, which turns about the folds.
        let x = if corner < 3 { place.x } else { -place.x * fold.cos() };
        [rounded(x - middle.x), rounded(place.y - middle.z)]
    });
    Some(seen.collect())
}

/// Which cameras see each direction, and the predicted standard deviation of the range there, at the distance of the zones.
///
/// Behind the header come for every cell its standard deviation in millimetres (32-bit float, little-endian; not a number where not
/// both cameras see it), then for every cell one byte: 1 where the left camera sees it, plus 2 where the right one does. Cells are row by
/// row from the zenith, in each row from azimuth -180 degrees to the right.
#[must_use]
pub fn sphere_message(rig: &Rig, values: &[f64]) -> Outgoing {
    let pose: RigPose = rig.pose_read_at(values);
    let field = DepthField::of_pose(rig, pose, PIXEL_SIGMA);
    let (cameras, middle) = (field.cameras(), field.middle());
    let mut sigmas = Vec::with_capacity(SPHERE_COLUMNS * SPHERE_ROWS * 5);
    let mut seen = Vec::with_capacity(SPHERE_COLUMNS * SPHERE_ROWS);
    let mut solid = [0.0; 3];
    for row in 0..SPHERE_ROWS {
        let elevation = Angle::from_deg(90.0 - (row as f64 + 0.5) * 180.0 / SPHERE_ROWS as f64);
        for column in 0..SPHERE_COLUMNS {
            let azimuth = Angle::from_deg((column as f64 + 0.5) * 360.0 / SPHERE_COLUMNS as f64 - 180.0);
            let bits = seen_by(&cameras, &place(&middle, [azimuth, elevation]));
            let sigma = if bits == 3 { field.at(azimuth, elevation, ZONE_RADIUS) } else { None };
            let sigma = sigma.map_or(f32::NAN, |predicted| predicted.sigma_range.mm() as f32);
            sigmas.extend_from_slice(&sigma.to_le_bytes());
            seen.push(bits);
            solid[bits.count_ones() as usize] += elevation.rad().cos();
        }
    }
    let whole: f64 = solid.iter().sum();
    let [blind, mono, stereo] = solid.map(|part| rounded(part / whole));
    let header = json!({
        "kind": "sphere", "columns": SPHERE_COLUMNS, "rows": SPHERE_ROWS, "range_mm": ZONE_RADIUS.mm(),
        "pixel_sigma": PIXEL_SIGMA, "shares": { "stereo": stereo, "mono": mono, "blind": blind },
    });
    sigmas.extend_from_slice(&seen);
    packed(&header, &sigmas)
}

/// The place in this direction from `middle`, at the distance of the zones: [`DepthField::at`] defines the angles.
fn place(middle: &Point<vergence_vision::Base>, [azimuth, elevation]: [Angle; 2]) -> Point<vergence_vision::Base> {
    let (az, el, radius) = (azimuth.rad(), elevation.rad(), ZONE_RADIUS.mm());
    let mut at = middle.mm();
    at.x += radius * az.sin() * el.cos();
    at.y -= radius * el.sin();
    at.z += radius * az.cos() * el.cos();
    Point::from_mm(at)
}

fn seen_by(cameras: &[PlacedCamera<'_>; 2], place: &Point<vergence_vision::Base>) -> u8 {
    let [left, right] = cameras.each_ref().map(|camera| u8::from(camera.sees(place)));
    left + 2 * right
}

#[cfg(test)]
mod tests {
    use vergence_rig::BENCH_TOML;

    use super::*;

    fn bench() -> Rig {
        Rig::from_toml(BENCH_TOML).expect("the bench")
    }

    fn sphere(rig: &Rig, values: &[f64]) -> (Value, Vec<f32>, Vec<u8>) {
        let Outgoing::Binary(bytes) = sphere_message(rig, values) else { panic!("binary") };
        let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        let header = serde_json::from_slice(&bytes[4..4 + length]).expect("JSON");
        let cells = SPHERE_COLUMNS * SPHERE_ROWS;
        let (sigmas, seen) = bytes[4 + length..].split_at(4 * cells);
        assert_eq!(seen.len(), cells);
        let sigmas = sigmas.chunks(4).map(|four| f32::from_le_bytes(four.try_into().expect("four bytes")));
        (header, sigmas.collect(), seen.to_vec())
    }

    #[test]
    fn the_map_shows_what_the_cameras_see_and_follows_the_stages() {
        let rig = bench();
        let ahead = SPHERE_ROWS / 2 * SPHERE_COLUMNS + SPHERE_COLUMNS / 2;
        let right = ahead + SPHERE_COLUMNS / 4;
        let (human, sigmas, seen) = sphere(&rig, &[145.0, 0.0]);
        assert_eq!(seen[ahead], 3);
        assert!(sigmas[ahead] > 0.0 && sigmas[ahead] < 5.0, "{}", sigmas[ahead]);
        let behind = SPHERE_ROWS / 2 * SPHERE_COLUMNS;
        assert_eq!(
            (seen[behind], sigmas[behind].is_nan()),
            (0, true),
            "parallel lenses of 196 degrees see nothing behind"
        );
        let (herbivore, turned, outward) = sphere(&rig, &[145.0, 120f64.to_radians()]);
        assert_eq!(outward[right], 2, "the right camera alone looks there");
        assert!(turned[right].is_nan());
        let stereo = |header: &Value| header["shares"]["stereo"].as_f64().expect("a share");
        assert!(stereo(&human) > stereo(&herbivore) + 0.2, "{human} {herbivore}");
        for (sigma, seen) in sigmas.iter().zip(&seen) {
            assert!(*seen == 3 || sigma.is_nan());
        }
    }

    #[test]
    fn the_view_from_above_agrees_with_the_zones_of_the_command_line() {
        let rig = bench();
        let view = view_json(&rig, &[145.0, 120f64.to_radians()]);
        let [left, right] = [0, 1].map(|side: usize| &view["cameras"][side]);
        assert_eq!((&left["place"], &right["place"]), (&json!([-72.5, 0.0]), &json!([72.5, 0.0])));
        assert_eq!((&left["axis_deg"], &right["axis_deg"]), (&json!(-60.0), &json!(60.0)));
        let pose = rig.pose_at_values(&[145.0, 120f64.to_radians()]);
        let zones = vergence_pipeline::rig_zones(&rig, &pose).expect("zones");
        assert_eq!(view["zones_deg"], zones_json(&zones));
        let arcs = view["arcs"].as_array().expect("arcs");
        let whole: f64 = arcs.iter().map(|arc| arc[1].as_f64().unwrap_or(0.0) - arc[0].as_f64().unwrap_or(0.0)).sum();
        assert!((whole - 360.0).abs() < 0.01, "{whole}");
        assert_eq!(view["trunk"], Value::Null);
    }

    #[test]
    fn the_corners_of_a_trunk_keep_the_lengths_of_its_links() {
        let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot");
        let values: Vec<f64> = rig.modes[0].targets.iter().map(|target| target.value()).collect();
        let view = view_json(&rig, &values);
        let corner = |index: usize| [0, 1].map(|axis: usize| view["trunk"][index % 6][axis].as_f64().expect("a place"));
        let trunk = rig.trunk.as_deref().expect("a trunk");
        if trunk.is_flat(&values) {
            let links = trunk.flat().links;
            for (first, length) in
                [links.side, links.side, links.end, links.side, links.side, links.end].iter().enumerate()
            {
                let ([x, y], [to_x, to_y]) = (corner(first), corner(first + 1));
                assert!(((to_x - x).hypot(to_y - y) - length).abs() < 0.01, "link {first}");
            }
        }
    }
}
