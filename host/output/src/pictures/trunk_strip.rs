//! A strip of pictures of the trunk along a path, from above, with what the cameras see.

use std::fmt::Write;

use vergence_pipeline::{RigView, ZONE_RADIUS};
use vergence_rig::linkage::TrunkPath;
use vergence_rig::{Rig, RigTrunk};
use vergence_vision::Coverage;

/// Number of pictures.
const PICTURES: usize = 6;
/// Size of a picture: width, height, and pixels to a millimetre.
const SIZE: [f64; 2] = [300.0, 380.0];
const SCALE: f64 = 0.36;
/// Place of the front link's middle in a picture.
const MIDDLE: [f64; 2] = [150.0, 150.0];
/// Step of the ring that shows the zones, in degrees.
const STEP: u32 = 3;

/// Draws the trunk of `rig` at even times along `path`: links, cameras, and on a circle around them what both cameras, one or none
/// see. Forward is up. Returns nothing for a rig without a trunk, or a path without legs.
#[must_use]
pub fn trunk_strip_svg(rig: &Rig, path: &TrunkPath) -> Option<String> {
    let trunk = rig.trunk.as_deref()?;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
        PICTURES as f64 * SIZE[0],
        SIZE[1] + 34.0
    );
    let seconds = path.seconds();
    for picture in 0..PICTURES {
        let at = seconds * picture as f64 / (PICTURES - 1) as f64;
        let (shape, room) = path.at(at)?;
        let values = trunk.values_of(&shape, rig.axes.len());
        let _ = writeln!(svg, "<g transform=\"translate({} 0)\">", picture as f64 * SIZE[0]);
        draw_zones(&mut svg, rig, &values);
        draw_trunk(&mut svg, trunk, &values);
        let _ = writeln!(
            svg,
            "<text x=\"{0}\" y=\"{1}\" text-anchor=\"middle\">{at:.1} s, side joint {2:.0}°</text>\
             <text x=\"{0}\" y=\"{3}\" text-anchor=\"middle\" fill=\"#555\">reserve {4:.1}°, gap {5:.0} mm</text>\n</g>",
            MIDDLE[0],
            SIZE[1] - 34.0,
            shape.0[1].to_degrees(),
            SIZE[1] - 14.0,
            room.loop_reserve.to_degrees(),
            room.gap.mm
        );
    }
    draw_legend(&mut svg);
    svg.push_str("</svg>\n");
    Some(svg)
}

fn draw_legend(svg: &mut String) {
    for ((name, coverage), column) in
        [("both cameras", Coverage::Stereo), ("one", Coverage::Mono), ("none", Coverage::Blind)]
            .into_iter()
            .zip([20, 160, 240])
    {
        let _ = writeln!(
            svg,
            "<rect x=\"{column}\" y=\"{0}\" width=\"16\" height=\"16\" fill=\"{1}\"/><text x=\"{2}\" y=\"{3}\">{name}</text>",
            SIZE[1] + 6.0,
            colour(coverage),
            column + 22,
            SIZE[1] + 19.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"320\" y=\"{}\" fill=\"#555\">see places on a circle of {ZONE_RADIUS:.0}; reserve: by how much every driven joint may \
         be off before the loop no longer closes; gap: distance of the nearest bodies</text>",
        SIZE[1] + 19.0
    );
}

const fn colour(coverage: Coverage) -> &'static str {
    match coverage {
        Coverage::Stereo => "#2a9d8f",
        Coverage::Mono => "#e9c46a",
        Coverage::Blind => "#495057",
    }
}

/// A place in millimetres right and forward of the front link's middle.
fn placed([right, forward]: [f64; 2]) -> [f64; 2] {
    [MIDDLE[0] + SCALE * right, MIDDLE[1] - SCALE * forward]
}

fn draw_zones(svg: &mut String, rig: &Rig, values: &[f64]) {
    let view = RigView::new(rig, &rig.pose_at_values(values), [None, None]);
    let centre = [view.middle.mm().x, view.middle.mm().z];
    let [x, y] = placed(centre);
    let radius = ZONE_RADIUS.mm();
    for step in 0..360 / STEP {
        let azimuth = |degrees: f64| degrees.to_radians().sin_cos();
        let begins = f64::from(step * STEP);
        let (sine, cosine) = azimuth(begins + 0.5 * f64::from(STEP));
        let coverage = match view.sees([radius * sine, radius * cosine]) {
            [true, true] => Coverage::Stereo,
            [false, false] => Coverage::Blind,
            _ => Coverage::Mono,
        };
        let drawn = SCALE * radius;
        let ends = [begins, begins + f64::from(STEP)].map(azimuth);
        let [from, to] = ends.map(|(sine, cosine)| [x + drawn * sine, y - drawn * cosine]);
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {:.1} A{drawn:.1} {drawn:.1} 0 0 1 {:.1} {:.1}\" stroke=\"{}\" stroke-width=\"10\" fill=\"none\"/>",
            from[0],
            from[1],
            to[0],
            to[1],
            colour(coverage)
        );
    }
}

fn draw_trunk(svg: &mut String, trunk: &RigTrunk, values: &[f64]) {
    let flat = trunk.flat();
    let places = flat.links.places(&trunk.shape(values));
    let points = places.map(|place| placed([place.x, place.y]));
    let corners: String = points.iter().map(|[x, y]| format!("{x:.1},{y:.1} ")).collect();
    let _ = writeln!(
        svg,
        "<polygon points=\"{corners}\" fill=\"none\" stroke=\"#8d99ae\" stroke-width=\"{:.1}\" stroke-linejoin=\"round\"/>",
        2.0 * SCALE * trunk.bodies.link
    );
    for (name, [x, y]) in ["A", "B", "C", "D", "E", "F"].into_iter().zip(points) {
        // The servos drive A, B and C.
        let fill = if matches!(name, "A" | "B" | "C") { "#d62828" } else { "white" };
        let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{fill}\" stroke=\"#222\"/>");
    }
    for camera in flat.cameras.centres(&places).into_iter().zip([[0, 1], [5, 4]]) {
        let (centre, [corner, other]) = camera;
        // The optical axis points outward by the mount's angle from the link's front end.
        let link = (places[corner] - places[other]).normalize();
        let turn = if corner == 0 { trunk.cameras.angle } else { -trunk.cameras.angle };
        let axis = turned([link.x, link.y], turn);
        let [x, y] = placed([centre.x, centre.y]);
        let [tip_x, tip_y] = placed([centre.x + 60.0 * axis[0], centre.y + 60.0 * axis[1]]);
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"#1d3557\"/>\
             <line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{tip_x:.1}\" y2=\"{tip_y:.1}\" stroke=\"#1d3557\" stroke-width=\"2\"/>",
            SCALE * trunk.bodies.camera
        );
    }
}

/// A direction turned against the clock.
fn turned([x, y]: [f64; 2], by: f64) -> [f64; 2] {
    let (sine, cosine) = by.sin_cos();
    [cosine * x - sine * y, sine * x + cosine * y]
}
