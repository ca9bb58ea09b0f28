//! A plan of the predicted depth error around the rig as SVG: forward up, coloured by the relative standard deviation.

use std::fmt::Write;

use vergence_page::escape;
use vergence_rig::DepthField;
use vergence_vision::{Angle, Length};

/// Radius of the plan in the drawing.
const HALF: f64 = 300.0;
/// Cells of the plan: in azimuth, and in range.
const AZIMUTHS: i32 = 180;
const RANGES: i32 = 24;
/// Relative standard deviations at the ends of the scale of colours, which is logarithmic.
const BEST: f64 = 5e-4;
const WORST: f64 = 5e-2;
/// The nearest range drawn, as a part of the farthest.
const NEAREST: f64 = 0.1;

/// The field in the horizontal plane out to `farthest`, with rings of range, rays of azimuth and a title.
#[must_use]
pub fn depth_field_svg(title: &str, field: &DepthField<'_>, farthest: Length) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{0} {1} {2} {3}\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect x=\"{0}\" y=\"{1}\" width=\"{2}\" height=\"{3}\" fill=\"white\"/>\n\
         <text y=\"{4}\" text-anchor=\"middle\" font-size=\"17\">{5}</text>\n",
        -HALF - 50.0,
        -HALF - 70.0,
        2.0 * HALF + 100.0,
        2.0 * HALF + 180.0,
        -HALF - 42.0,
        escape(title)
    );
    let _ = writeln!(svg, "<circle r=\"{HALF}\" fill=\"#eceff1\"/>");
    let share = |i: i32| NEAREST + (1.0 - NEAREST) * f64::from(i) / f64::from(RANGES);
    for i in 0..AZIMUTHS {
        let edges = [i, i + 1].map(|i| Angle::from_deg(f64::from(i) * 360.0 / f64::from(AZIMUTHS)));
        for k in 0..RANGES {
            let (near, far) = (share(k), share(k + 1));
            let range = farthest * (0.5 * (near + far));
            let azimuth = (edges[0] + edges[1]) / 2.0;
            let Some(predicted) = field.at(azimuth, Angle::from_rad(0.0), range) else { continue };
            let fill = colour(predicted.sigma_range.mm() / range.mm());
            cell(&mut svg, edges, [near, far], &fill);
        }
    }
    rings(&mut svg, farthest);
    legend(&mut svg, farthest);
    svg.push_str("</svg>\n");
    svg
}

fn cell(svg: &mut String, [from, to]: [Angle; 2], [near, far]: [f64; 2], fill: &str) {
    let at = |azimuth: Angle, share: f64| (HALF * share * azimuth.rad().sin(), -HALF * share * azimuth.rad().cos());
    let corners = [at(from, near), at(from, far), at(to, far), at(to, near)];
    let points: Vec<_> = corners.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(svg, "<polygon points=\"{0}\" fill=\"{fill}\" stroke=\"{fill}\"/>", points.join(" "));
}

/// Rings of equal range and rays of equal azimuth, with their values.
fn rings(svg: &mut String, farthest: Length) {
    const RINGS: i32 = 4;
    for ring in 1..=RINGS {
        let share = f64::from(ring) / f64::from(RINGS);
        let radius = HALF * share;
        let _ = writeln!(
            svg,
            "<circle r=\"{radius:.1}\" fill=\"none\" stroke=\"#222\" stroke-opacity=\"0.45\"/>\
             <text x=\"4\" y=\"{:.1}\" stroke=\"white\" stroke-width=\"3\" paint-order=\"stroke\">{:.0}</text>",
            radius - 5.0,
            farthest * share
        );
    }
    for degrees in (-150..=180).step_by(30) {
        let azimuth = Angle::from_deg(f64::from(degrees));
        let at = |radius: f64| (radius * azimuth.rad().sin(), -radius * azimuth.rad().cos());
        let ((x, y), (text_x, text_y)) = (at(HALF), at(HALF + 20.0));
        let _ = writeln!(
            svg,
            "<line x2=\"{x:.1}\" y2=\"{y:.1}\" stroke=\"#222\" stroke-opacity=\"0.25\"/>\
             <text x=\"{text_x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{degrees}°</text>",
            text_y + 5.0
        );
    }
}

/// From green over yellow to red.
fn colour(relative: f64) -> String {
    const STOPS: [[f64; 3]; 3] = [[42.0, 157.0, 143.0], [233.0, 196.0, 106.0], [193.0, 18.0, 31.0]];
    let place = 2.0 * ((relative / BEST).ln() / (WORST / BEST).ln()).clamp(0.0, 1.0);
    let (from, to, share) = if place < 1.0 { (STOPS[0], STOPS[1], place) } else { (STOPS[1], STOPS[2], place - 1.0) };
    let [red, green, blue] = [0, 1, 2].map(|i| (from[i] + share * (to[i] - from[i])).round());
    format!("rgb({red},{green},{blue})")
}

fn legend(svg: &mut String, farthest: Length) {
    let (left, y) = (-HALF, HALF + 40.0);
    const STEPS: i32 = 60;
    for i in 0..STEPS {
        let place = f64::from(i) / f64::from(STEPS);
        let fill = colour(BEST * (WORST / BEST).powf(place));
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y}\" width=\"5.2\" height=\"14\" fill=\"{fill}\"/>",
            left + 300.0 * place
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{left}\" y=\"{0}\">{1} %</text><text x=\"{2}\" y=\"{0}\" text-anchor=\"end\">{3} %</text>\
         <text x=\"{4}\" y=\"{5}\">standard deviation of the range; grey: not seen by both cameras; rim {farthest:.0}</text>",
        y + 32.0,
        100.0 * BEST,
        left + 300.0,
        100.0 * WORST,
        left,
        y + 54.0
    );
}
