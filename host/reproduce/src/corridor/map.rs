//! A map of the corridor from above, with the points of all measurements.

use std::fmt::Write;

use vergence_scene::Scene;

use super::Station;

/// Pixels to a millimetre, and the margin.
const SCALE: f64 = 0.28;
const MARGIN: f64 = 60.0;
/// Part of the corridor that is drawn, along it, in millimetres.
const ALONG: [f64; 2] = [-1000.0, 3400.0];

/// Draws the map as SVG: along the corridor to the right, its left side up.
pub fn corridor_map(stations: &[Station]) -> String {
    let half = Scene::CORRIDOR_HALF_WIDTH;
    let (width, height) = ((ALONG[1] - ALONG[0]) * SCALE + 2.0 * MARGIN, 2.0 * half * SCALE + 2.0 * MARGIN + 40.0);
    let place = |x: f64, z: f64| [MARGIN + (z - ALONG[0]) * SCALE, MARGIN + (x + half) * SCALE];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"white\"/>\n"
    );
    for side in [-half, half] {
        let [from, to] = ALONG.map(|z| place(side, z));
        let _ = writeln!(
            svg,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#bbb\" stroke-width=\"3\"/>",
            from[0], from[1], to[0], to[1]
        );
    }
    for station in stations {
        draw_points(&mut svg, station, &place);
    }
    let [x, _, z] = Scene::CORRIDOR_TARGET;
    let [u, v] = place(x, z);
    let _ = writeln!(
        svg,
        "<circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"{:.1}\" fill=\"none\" stroke=\"#d00000\" stroke-width=\"2\"/>",
        SCALE * Scene::CORRIDOR_TARGET_RADIUS
    );
    for (number, station) in stations.iter().enumerate() {
        draw_robot(&mut svg, number, station, &place);
    }
    for (column, mode) in ["gecko", "spider", "stick-bug"].into_iter().enumerate() {
        let u = MARGIN + 130.0 * column as f64;
        let _ = writeln!(
            svg,
            "<circle cx=\"{u}\" cy=\"{0:.0}\" r=\"6\" fill=\"{1}\"/><text x=\"{2}\" y=\"{3:.0}\">{mode}</text>",
            height - 26.0,
            colour(mode),
            u + 12.0,
            height - 21.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{:.0}\" fill=\"#555\">dots: measured points; grey lines: true walls; red ring: true target; numbers: where the \
         robot stood</text>\n</svg>",
        MARGIN + 420.0,
        height - 21.0
    );
    svg
}

fn colour(mode: &str) -> &'static str {
    match mode {
        "gecko" => "#e9a03b",
        "spider" => "#2a9d8f",
        _ => "#3d5a98",
    }
}

/// Points from knee height to the top of the parcels; floor and ceiling would cover all else.
fn draw_points(svg: &mut String, station: &Station, place: &impl Fn(f64, f64) -> [f64; 2]) {
    const HEIGHTS: std::ops::Range<f64> = -400.0..100.0;
    let _ = writeln!(svg, "<g fill=\"{}\" fill-opacity=\"0.6\">", colour(&station.mode));
    for point in station.in_corridor() {
        let at = point.mm();
        let is_inside = HEIGHTS.contains(&at.y) && (ALONG[0]..ALONG[1]).contains(&at.z) && at.x.abs() < 700.0;
        if is_inside {
            let [u, v] = place(at.x, at.z);
            let _ = writeln!(svg, "<circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"1.6\"/>");
        }
    }
    svg.push_str("</g>\n");
}

fn draw_robot(svg: &mut String, number: usize, station: &Station, place: &impl Fn(f64, f64) -> [f64; 2]) {
    let [u, v] = place(station.place.x, station.place.along);
    let (sine, cosine) = station.place.yaw.rad().sin_cos();
    let [tip_u, tip_v] = place(station.place.x + 120.0 * sine, station.place.along + 120.0 * cosine);
    // Several modes at one place stand beside each other.
    let beside = match station.mode.as_str() {
        "gecko" => -14.0,
        "spider" => 14.0,
        _ => 0.0,
    };
    let _ = writeln!(
        svg,
        "<g transform=\"translate(0 {beside})\"><line x1=\"{u:.1}\" y1=\"{v:.1}\" x2=\"{tip_u:.1}\" y2=\"{tip_v:.1}\" stroke=\"#222\" \
         stroke-width=\"2\"/><circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"11\" fill=\"{}\" stroke=\"#222\"/>\
         <text x=\"{u:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\">{number}</text></g>",
        colour(&station.mode),
        v + 4.0
    );
}
