//! A strip of pictures of the trunk along a path, from above, with what the cameras see.

use std::f64::consts::PI;
use std::fmt::Write;

use nalgebra::{UnitQuaternion, Vector3};
use vergence_pipeline::{RigView, ZONE_RADIUS};
use vergence_rig::linkage::{TrunkPath, TrunkShape};
use vergence_rig::{Rig, RigTrunk};
use vergence_vision::{Base, Coverage, Transform};

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
/// see. Forward is up. A folded trunk is seen with both halves sloping alike, and from its front in a corner of the picture. Returns nothing for a rig without a trunk, or a path without legs.
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
    let is_folded = path.legs.iter().flat_map(|leg| &leg.samples).any(|sample| !sample.shape.is_flat());
    for picture in 0..PICTURES {
        let at = seconds * picture as f64 / (PICTURES - 1) as f64;
        let (shape, room) = path.at(at)?;
        let values = trunk.values_of(&shape, rig.axes.len());
        let _ = writeln!(svg, "<g transform=\"translate({} 0)\">", picture as f64 * SIZE[0]);
        let drawn = Drawn::of(trunk, &shape);
        draw_zones(&mut svg, rig, (&values, shape.fold), drawn.middle());
        draw_trunk(&mut svg, trunk, &drawn);
        if is_folded {
            draw_front(&mut svg, &shape);
        }
        let _ = writeln!(
            svg,
            "<text x=\"{0}\" y=\"{1}\" text-anchor=\"middle\">{at:.1} s, side joint {2:.0}°</text>\
             <text x=\"{0}\" y=\"{3}\" text-anchor=\"middle\" fill=\"#555\">reserve {4:.1}°, gap {5:.0} mm</text>\n</g>",
            MIDDLE[0],
            SIZE[1] - 34.0,
            shape.corners.0[1].to_degrees(),
            SIZE[1] - 14.0,
            room.loop_reserve.to_degrees(),
            room.gap.mm
        );
    }
    draw_legend(&mut svg);
    svg.push_str("</svg>\n");
    Some(svg)
}

/// The trunk as it is seen from above: right and forward in millimetres.
struct Drawn {
    corners: [[f64; 2]; 6],
    cameras: [[f64; 2]; 2],
    /// Directions of the optical axes.
    axes: [[f64; 2]; 2],
}

impl Drawn {
    fn of(trunk: &RigTrunk, shape: &TrunkShape) -> Self {
        let flat = trunk.flat();
        let places = flat.links.places(&shape.corners);
        // Each half slopes by half of the fold, about a hinge above it.
        let (sine, cosine) = (0.5 * (PI - shape.fold)).sin_cos();
        let hinge = trunk.links.fold_offset * sine;
        let seen = |side: f64, [x, y]: [f64; 2]| [cosine * x - side * hinge, y];
        let sides = [-1.0, 1.0];
        let axis = |[corner, other]: [usize; 2], turn: f64, side: f64| {
            // The optical axis points outward by the mount's angle from the link's front end.
            let link = (places[corner] - places[other]).normalize();
            let [x, y] = turned([link.x, link.y], -side * turn);
            [cosine * x, y]
        };
        let centres = flat.cameras.centres(&places);
        Self {
            corners: std::array::from_fn(|corner| {
                seen(if corner < 3 { -1.0 } else { 1.0 }, [places[corner].x, places[corner].y])
            }),
            cameras: [0, 1].map(|side: usize| seen(sides[side], [centres[side].x, centres[side].y])),
            axes: [axis([0, 1], trunk.cameras.left.angle, sides[0]), axis([5, 4], trunk.cameras.right.angle, sides[1])],
        }
    }

    /// The place midway between the cameras.
    fn middle(&self) -> [f64; 2] {
        let [left, right] = self.cameras;
        [0, 1].map(|axis: usize| f64::midpoint(left[axis], right[axis]))
    }
}

/// Both halves as they are seen from the front, with the hinge between them.
fn draw_front(svg: &mut String, shape: &TrunkShape) {
    const HINGE: [f64; 2] = [262.0, 26.0];
    const HALF: f64 = 24.0;
    let (sine, cosine) = (0.5 * (PI - shape.fold)).sin_cos();
    let [x, y] = HINGE;
    let _ = writeln!(
        svg,
        "<polyline points=\"{:.1},{:.1} {x},{y} {:.1},{:.1}\" fill=\"none\" stroke=\"#8d99ae\" stroke-width=\"6\"/>\
         <text x=\"{x}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\">folds {:.0}°</text>",
        x - HALF * cosine,
        y + HALF * sine,
        x + HALF * cosine,
        y + HALF * sine,
        y - 12.0,
        shape.fold.to_degrees()
    );
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
        "<text x=\"320\" y=\"{}\" fill=\"#555\">see places on a circle of {ZONE_RADIUS:.0}; reserve: by how much every driven joint \
         may be off before the loop no longer closes; gap: distance of the nearest bodies</text>",
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

/// The zones in the plane from which both halves of the trunk slope alike.
fn draw_zones(svg: &mut String, rig: &Rig, (values, fold): (&[f64], f64), middle: [f64; 2]) {
    let mut pose = rig.pose_at_values(values);
    // The base is the left half, which slopes by half of the fold: z of the base points forward, and the right half lies deeper.
    let slope = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -0.5 * (PI - fold));
    pose.base_from_left = Transform::<Base, Base>::new(slope, Vector3::zeros()) * pose.base_from_left;
    let view = RigView::new(rig, &pose, [None, None]);
    let [x, y] = placed(middle);
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

fn draw_trunk(svg: &mut String, trunk: &RigTrunk, drawn: &Drawn) {
    let points = drawn.corners.map(placed);
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
    for (centre, axis) in drawn.cameras.into_iter().zip(drawn.axes) {
        let [x, y] = placed(centre);
        let [tip_x, tip_y] = placed([centre[0] + 60.0 * axis[0], centre[1] + 60.0 * axis[1]]);
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
