//! A plan of the zones as SVG: who sees which part of the circle around the rig.

use std::fmt::Write;

use vergence_vision::{Angle, Coverage, Length, PlanarCamera, ZoneMap};

const STEREO: &str = "#2a9d8f";
const MONO: &str = "#e9c46a";
const BLIND: &str = "#495057";
/// Half the size of the picture, and the circle in it.
const HALF: f64 = 260.0;
const CIRCLE: f64 = 210.0;

/// The plan, forward up.
#[must_use]
pub fn zones_svg(map: &ZoneMap, cameras: &[PlanarCamera; 2], radius: Length) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{0} {0} {1} {2}\" font-family=\"sans-serif\" font-size=\"15\">\n\
         <rect x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{2}\" fill=\"white\"/>\n",
        -HALF,
        2.0 * HALF,
        2.0 * HALF + 70.0
    );
    for arc in &map.arcs {
        draw_sector(&mut svg, arc.start, arc.end, colour(arc.coverage));
    }
    let scale = CIRCLE / radius.mm();
    for camera in cameras {
        draw_camera(&mut svg, camera, scale);
    }
    let zones = &map.zones;
    let entries = [("stereo", zones.stereo, STEREO), ("mono", zones.mono, MONO), ("blind", zones.blind, BLIND)];
    for ((name, angle, fill), column) in entries.into_iter().zip([-220.0, -60.0, 100.0]) {
        let y = HALF + 20.0;
        let _ = writeln!(
            svg,
            "<rect x=\"{column}\" y=\"{y}\" width=\"18\" height=\"18\" fill=\"{fill}\"/>\
             <text x=\"{}\" y=\"{}\">{name} {angle:.1}</text>",
            column + 26.0,
            y + 14.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"0\" y=\"{}\" text-anchor=\"middle\">forward</text>\
         <text x=\"0\" y=\"{}\" text-anchor=\"middle\" fill=\"#555\">circle of {radius:.0} around the rig</text>\n</svg>",
        -CIRCLE - 14.0,
        HALF
    );
    svg
}

const fn colour(coverage: Coverage) -> &'static str {
    match coverage {
        Coverage::Stereo => STEREO,
        Coverage::Mono => MONO,
        Coverage::Blind => BLIND,
    }
}

/// On the circle at `azimuth` from forward; forward is up, and y of an SVG points down.
fn on_circle(azimuth: Angle, radius: f64) -> (f64, f64) {
    (radius * azimuth.rad().sin(), -radius * azimuth.rad().cos())
}

fn draw_sector(svg: &mut String, start: Angle, end: Angle, fill: &str) {
    let width = (end - start).deg();
    if width >= 359.999 {
        let _ = writeln!(svg, "<circle r=\"{CIRCLE}\" fill=\"{fill}\" fill-opacity=\"0.85\"/>");
        return;
    }
    let ((x0, y0), (x1, y1)) = (on_circle(start, CIRCLE), on_circle(end, CIRCLE));
    let large = i32::from(width > 180.0);
    let _ = writeln!(
        svg,
        "<path d=\"M0 0 L{x0:.2} {y0:.2} A{CIRCLE} {CIRCLE} 0 {large} 1 {x1:.2} {y1:.2} Z\" fill=\"{fill}\" \
         fill-opacity=\"0.85\" stroke=\"white\"/>"
    );
}

/// The optical centre, its axis and the edges of its field.
fn draw_camera(svg: &mut String, camera: &PlanarCamera, scale: f64) {
    let [x, forward] = camera.centre_mm;
    let (cx, cy) = (x * scale, -forward * scale);
    let mut ray = |azimuth: Angle, length: f64, style: &str| {
        let (dx, dy) = on_circle(azimuth, length);
        let _ =
            writeln!(svg, "<line x1=\"{cx:.2}\" y1=\"{cy:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" {style}/>", cx + dx, cy + dy);
    };
    ray(camera.axis, 90.0, "stroke=\"#222\" stroke-width=\"3\"");
    for side in [-1.0, 1.0] {
        ray(camera.axis + camera.half_field * side, 250.0, "stroke=\"#222\" stroke-dasharray=\"4 5\"");
    }
    let _ = writeln!(svg, "<circle cx=\"{cx:.2}\" cy=\"{cy:.2}\" r=\"9\" fill=\"#222\"/>");
}
