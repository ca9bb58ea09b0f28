//! A map of the corridor from above, with the points of all measurements.

use std::fmt::Write;

use vergence_scene::CorridorPlan;

use super::{STORY, Station};

/// Pixels to a millimetre, and the margins at the sides, at the top and at the bottom.
const SCALE: f64 = 0.28;
const SIDES: f64 = 50.0;
const TOP: f64 = 56.0;
const BOTTOM: f64 = 112.0;
/// Distance of the marks of the scale, in millimetres.
const MARKS: f64 = 500.0;
/// Heights of the drawn points, in millimetres down from the cameras: from 50 to 550 above the floor. Floor and ceiling would cover all
/// else.
const HEIGHTS: std::ops::Range<f64> = -400.0..100.0;
/// How far outside a wall points are still drawn, in millimetres.
const OUTSIDE: f64 = 150.0;

/// A corridor as it is drawn: along it to the right, its left side up.
struct Map<'p> {
    plan: &'p CorridorPlan,
    svg: String,
}

/// Draws the map as SVG.
pub fn corridor_map(plan: &CorridorPlan, stations: &[Station]) -> String {
    let mut map = Map { plan, svg: String::new() };
    let [width, height] = map.size();
    let _ = writeln!(
        map.svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" \
         font-size=\"14\">\n<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"white\"/>\n\
         <text x=\"{SIDES}\" y=\"26\" font-size=\"18\">The corridor from above: what stands in it, and what was measured</text>"
    );
    map.draw_truth();
    map.draw_scale();
    for station in stations {
        map.draw_points(station);
    }
    for (number, station) in stations.iter().enumerate() {
        map.draw_robot(number, station);
    }
    map.draw_legend();
    map.svg.push_str("</svg>\n");
    map.svg
}

fn colour(mode: &str) -> &'static str {
    match mode {
        "gecko" => "#e9a03b",
        "spider" => "#2a9d8f",
        _ => "#3d5a98",
    }
}

impl Map<'_> {
    fn size(&self) -> [f64; 2] {
        let [back, front] = self.plan.ends;
        [(front - back) * SCALE + 2.0 * SIDES, 2.0 * self.plan.half_width * SCALE + TOP + BOTTOM]
    }

    /// Where a place across and along the corridor is drawn.
    fn place(&self, across: f64, along: f64) -> [f64; 2] {
        [SIDES + (along - self.plan.ends[0]) * SCALE, TOP + (across + self.plan.half_width) * SCALE]
    }

    /// Walls, parcels and the target, as they truly stand.
    fn draw_truth(&mut self) {
        let half = self.plan.half_width;
        let [[left, top], [right, bottom]] =
            [self.place(-half, self.plan.ends[0]), self.place(half, self.plan.ends[1])];
        let _ = writeln!(
            self.svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" stroke=\"#bbb\" stroke-width=\"3\"/>",
            right - left,
            bottom - top
        );
        for &[across, along, yaw, width, _, depth] in &self.plan.parcels {
            let (sine, cosine) = yaw.to_radians().sin_cos();
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]| {
                let [x, z] = [a * width / 2.0, b * depth / 2.0];
                self.place(across + cosine * x + sine * z, along - sine * x + cosine * z)
            });
            let corners: String = corners.iter().map(|[u, v]| format!("{u:.1},{v:.1} ")).collect();
            let _ = writeln!(self.svg, "<polygon points=\"{corners}\" fill=\"#eee\" stroke=\"#bbb\"/>");
        }
        let [x, _, z] = self.plan.target;
        let [u, v] = self.place(x, z);
        let radius = SCALE * CorridorPlan::TARGET_RADIUS;
        let _ = writeln!(
            self.svg,
            "<circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"{radius:.1}\" fill=\"#fbe3e3\" stroke=\"#d00000\" stroke-width=\"2\"/>"
        );
    }

    /// Marks below the corridor, with the distance from where the robot starts.
    fn draw_scale(&mut self) {
        let [from, to] = self.plan.ends.map(|end| end / MARKS);
        for mark in from.ceil() as i32..=to.floor() as i32 {
            let along = f64::from(mark) * MARKS;
            let [u, v] = self.place(self.plan.half_width, along);
            let _ = writeln!(
                self.svg,
                "<line x1=\"{u:.1}\" y1=\"{:.1}\" x2=\"{u:.1}\" y2=\"{:.1}\" stroke=\"#777\"/>\
                 <text x=\"{u:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\" fill=\"#555\">{:.1} m</text>",
                v + 2.0,
                v + 9.0,
                v + 23.0,
                along / 1e3
            );
        }
    }

    fn draw_points(&mut self, station: &Station) {
        let _ = writeln!(self.svg, "<g fill=\"{}\" fill-opacity=\"0.7\">", colour(&station.mode));
        let [back, front] = self.plan.ends;
        for point in station.in_corridor() {
            let at = point.mm();
            let is_inside = HEIGHTS.contains(&at.y)
                && (back..front + OUTSIDE).contains(&at.z)
                && at.x.abs() < self.plan.half_width + OUTSIDE;
            if is_inside {
                let [u, v] = self.place(at.x, at.z);
                let _ = writeln!(self.svg, "<circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"1.6\"/>");
            }
        }
        self.svg.push_str("</g>\n");
    }

    /// A dot where the robot stood, a line to where it looked, and its number beside it: modes at one place do not cover each other.
    fn draw_robot(&mut self, number: usize, station: &Station) {
        let [u, v] = self.place(station.place.x, station.place.along);
        let (sine, cosine) = station.place.yaw.rad().sin_cos();
        let [tip_u, tip_v] = self.place(station.place.x + 110.0 * sine, station.place.along + 110.0 * cosine);
        let beside = v + match station.mode.as_str() {
            "gecko" => -24.0,
            "spider" => 24.0,
            _ => 48.0,
        };
        let _ = writeln!(
            self.svg,
            "<line x1=\"{u:.1}\" y1=\"{v:.1}\" x2=\"{u:.1}\" y2=\"{beside:.1}\" stroke=\"#999\"/>\
             <line x1=\"{u:.1}\" y1=\"{v:.1}\" x2=\"{tip_u:.1}\" y2=\"{tip_v:.1}\" stroke=\"#222\" stroke-width=\"2\"/>\
             <circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"3.5\" fill=\"#222\"/>\
             <circle cx=\"{u:.1}\" cy=\"{beside:.1}\" r=\"11\" fill=\"{}\" stroke=\"#222\"/>\
             <text x=\"{u:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\">{number}</text>",
            colour(&station.mode),
            beside + 4.0
        );
    }

    fn draw_legend(&mut self) {
        let [_, height] = self.size();
        let line = height - 46.0;
        for (column, mode) in STORY.into_iter().enumerate() {
            let u = SIDES + 8.0 + 110.0 * column as f64;
            let _ = writeln!(
                self.svg,
                "<circle cx=\"{u}\" cy=\"{:.0}\" r=\"6\" fill=\"{}\"/><text x=\"{}\" y=\"{line:.0}\">{mode}</text>",
                line - 5.0,
                colour(mode),
                u + 12.0
            );
        }
        let _ = writeln!(
            self.svg,
            "<g fill=\"#555\"><text x=\"{}\" y=\"{line:.0}\">small dots: points measured in this mode, 5 cm to 55 cm above the floor</text>\
             <text x=\"{SIDES}\" y=\"{:.0}\">numbered: where the robot stood (black dot) and looked (line); true: walls and parcels grey, \
             target red; distances from the start</text></g>",
            SIDES + 340.0,
            line + 24.0
        );
    }
}
