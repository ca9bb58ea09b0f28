//! A plan of the zones as SVG: which places around the rig both cameras, one or none see.

use std::fmt::Write;
use std::io::Cursor;

use image::{ImageError, ImageFormat, Rgb, RgbImage};
use vergence_page::data_url;
use vergence_vision::{Angle, Coverage, Length, PlanarCamera, Zones};

const STEREO: [u8; 3] = [42, 157, 143];
const MONO: [u8; 3] = [233, 196, 106];
const BLIND: [u8; 3] = [73, 80, 87];
/// The border of the stereo zone.
const OUTLINE: [u8; 3] = [11, 61, 56];
/// Half the size of the drawing, and the radius of the circle in it.
const HALF: f64 = 260.0;
const CIRCLE: f64 = 210.0;
/// Pixels along the diameter of the circle: two for each unit of the drawing.
const PIXELS: u32 = 840;
/// Width of the outline of the stereo zone, in pixels.
const OUTLINE_PIXELS: i64 = 3;

/// Which cameras (left, right) see a place in the horizontal plane: millimetres right and forward of the middle of the rig.
pub type Sees<'a> = &'a dyn Fn([f64; 2]) -> [bool; 2];

/// The plan of the circle of `radius`, forward up: `sees` colours every place in it, `zones` are the angles on the circle.
///
/// # Errors
/// Where the picture of the zones cannot be encoded.
pub fn zones_svg(
    zones: &Zones,
    cameras: &[PlanarCamera; 2],
    radius: Length,
    sees: Sees<'_>,
) -> Result<String, ImageError> {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{0} {0} {1} {2}\" font-family=\"sans-serif\" font-size=\"15\">\n\
         <rect x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{2}\" fill=\"white\"/>\n",
        -HALF,
        2.0 * HALF,
        2.0 * HALF + 70.0
    );
    let mut bytes = Cursor::new(Vec::new());
    coverage_image(radius, sees).write_to(&mut bytes, ImageFormat::Png)?;
    let url = data_url("image/png", bytes.get_ref());
    let _ = writeln!(
        svg,
        "<image x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{1}\" href=\"{url}\"/>\n\
         <circle r=\"{CIRCLE}\" fill=\"none\" stroke=\"#222\" stroke-width=\"1.5\"/>",
        -CIRCLE,
        2.0 * CIRCLE
    );
    for camera in cameras {
        draw_camera(&mut svg, camera, CIRCLE / radius.mm());
    }
    let entries = [("stereo", zones.stereo, STEREO), ("mono", zones.mono, MONO), ("blind", zones.blind, BLIND)];
    for ((name, angle, [red, green, blue]), column) in entries.into_iter().zip([-220.0, -60.0, 100.0]) {
        let y = HALF + 20.0;
        let _ = writeln!(
            svg,
            "<rect x=\"{column}\" y=\"{y}\" width=\"18\" height=\"18\" fill=\"rgb({red},{green},{blue})\"/>\
             <text x=\"{}\" y=\"{}\">{name} {angle:.1}</text>",
            column + 26.0,
            y + 14.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"0\" y=\"{}\" text-anchor=\"middle\">forward</text>\
         <text x=\"0\" y=\"{}\" text-anchor=\"middle\" fill=\"#555\">circle of {radius:.0} around the rig; angles on the \
         circle</text>\n</svg>",
        -CIRCLE - 14.0,
        HALF
    );
    Ok(svg)
}

/// Which cameras (left, right) see a place, where their fields are cones about their axes.
#[must_use]
pub fn seen_by_cones(cameras: &[PlanarCamera; 2], [x, forward]: [f64; 2]) -> [bool; 2] {
    cameras.each_ref().map(|camera| {
        let [dx, dy] = [x - camera.centre_mm[0], forward - camera.centre_mm[1]];
        let off = dx.atan2(dy) - camera.axis.rad();
        off.sin().atan2(off.cos()).abs() <= camera.half_field.rad()
    })
}

const fn coverage([left, right]: [bool; 2]) -> Coverage {
    match (left, right) {
        (true, true) => Coverage::Stereo,
        (false, false) => Coverage::Blind,
        _ => Coverage::Mono,
    }
}

/// The circle of `radius` from above, coloured by who sees each place; the stereo zone has an outline, and what lies outside
/// the circle is white.
fn coverage_image(radius: Length, sees: Sees<'_>) -> RgbImage {
    let middle = 0.5 * f64::from(PIXELS);
    let scale = radius.mm() / middle;
    let place = |x: u32, y: u32| [(f64::from(x) + 0.5 - middle) * scale, (middle - f64::from(y) - 0.5) * scale];
    let zones: Vec<Option<Coverage>> = (0..PIXELS * PIXELS)
        .map(|index| {
            let at = place(index % PIXELS, index / PIXELS);
            (at[0].hypot(at[1]) <= radius.mm()).then(|| coverage(sees(at)))
        })
        .collect();
    let zone_at = |x: i64, y: i64| {
        let inside = (0..i64::from(PIXELS)).contains(&x) && (0..i64::from(PIXELS)).contains(&y);
        if inside { zones.get((y * i64::from(PIXELS) + x) as usize).copied().flatten() } else { None }
    };
    RgbImage::from_fn(PIXELS, PIXELS, |x, y| {
        let (x, y) = (i64::from(x), i64::from(y));
        let beside = [(OUTLINE_PIXELS, 0), (-OUTLINE_PIXELS, 0), (0, OUTLINE_PIXELS), (0, -OUTLINE_PIXELS)];
        Rgb(match zone_at(x, y) {
            None => [255; 3],
            Some(Coverage::Stereo) => {
                let border = beside.iter().any(|(dx, dy)| zone_at(x + dx, y + dy) != Some(Coverage::Stereo));
                if border { OUTLINE } else { STEREO }
            }
            Some(Coverage::Mono) => MONO,
            Some(Coverage::Blind) => BLIND,
        })
    })
}

/// The optical centre, its axis and the edges of its field.
fn draw_camera(svg: &mut String, camera: &PlanarCamera, scale: f64) {
    let [x, forward] = camera.centre_mm;
    let (cx, cy) = (x * scale, -forward * scale);
    let mut ray = |azimuth: Angle, length: f64, style: &str| {
        let (dx, dy) = (length * azimuth.rad().sin(), -length * azimuth.rad().cos());
        let _ =
            writeln!(svg, "<line x1=\"{cx:.2}\" y1=\"{cy:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" {style}/>", cx + dx, cy + dy);
    };
    ray(camera.axis, 90.0, "stroke=\"#222\" stroke-width=\"3\"");
    for side in [-1.0, 1.0] {
        ray(camera.axis + camera.half_field * side, 250.0, "stroke=\"#222\" stroke-dasharray=\"4 5\"");
    }
    let _ = writeln!(svg, "<circle cx=\"{cx:.2}\" cy=\"{cy:.2}\" r=\"9\" fill=\"#222\"/>");
}

#[cfg(test)]
mod tests {
    use vergence_vision::symmetric_pair;

    use super::*;

    /// Between two cameras that look outward there is a place in front of the rig that neither sees, though the circle beyond
    /// it lies in the stereo zone.
    #[test]
    fn stereo_is_painted_where_both_cameras_see() {
        let cameras = symmetric_pair(Length::from_mm(145.0), Angle::from_deg(120.0), Angle::from_deg(196.0));
        let image = coverage_image(Length::from_mm(350.0), &|place| seen_by_cones(&cameras, place));
        let at = |x_mm: f64, forward_mm: f64| {
            let pixel = |mm: f64| ((mm / 350.0 + 1.0) * 0.5 * f64::from(PIXELS)) as u32;
            image.get_pixel(pixel(x_mm), pixel(-forward_mm)).0
        };
        assert_eq!(at(0.0, 300.0), STEREO);
        assert_eq!(at(0.0, 40.0), BLIND);
        assert_eq!(at(-300.0, 0.0), MONO);
        assert_eq!(image.get_pixel(0, 0).0, [255; 3], "outside the circle");
        assert!(image.pixels().any(|pixel| pixel.0 == OUTLINE));
    }
}
