//! Curves of the zones over separation and over radius as SVG, the published equation dashed where it applies.

use std::fmt::Write;

use vergence_vision::{Angle, Length, PlanarCamera, Zones, paper_eq3, paper_eq3_applies, symmetric_pair, zones_exact};

/// A rig of two equal cameras.
#[derive(Clone, Copy, Debug)]
pub struct ZonesOf {
    /// Distance of the optical centres.
    pub baseline: Length,
    /// Angle between the optical axes, outward positive.
    pub separation: Angle,
    /// Full horizontal field of each lens.
    pub field: Angle,
    /// Radius of the circle on which the zones are angles.
    pub radius: Length,
}

/// A zone's name, its colour, and which it is.
type Curve = (&'static str, &'static str, fn(&Zones) -> Angle);
const CURVES: [Curve; 3] = [
    ("stereo", "#1d7a6f", |zones| zones.stereo),
    ("mono", "#c98a16", |zones| zones.mono),
    ("blind", "#495057", |zones| zones.blind),
];
const SEPARATIONS: [f64; 2] = [-60.0, 160.0];
/// The largest radius drawn.
const FARTHEST_MM: f64 = 10_000.0;
const POINTS: u32 = 440;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 320.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 46.0;
const GAP: f64 = 80.0;

/// Two diagrams side by side: angles over the separation at the rig's radius, and over the radius at its separation.
#[must_use]
pub fn zones_plot(rig: &ZonesOf) -> String {
    let (wide, tall) = (2.0 * (LEFT + WIDTH) + GAP - 30.0, TOP + HEIGHT + 86.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {wide} {tall}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"{wide}\" height=\"{tall}\" fill=\"white\"/>\n"
    );
    let nearest = 1.02 * 0.5 * rig.baseline.mm();
    let over_separation = Diagram {
        left: LEFT,
        title: format!("baseline {:.0}, field {:.2}, radius {:.0}", rig.baseline, rig.field, rig.radius),
        axis: "separation of the axes in degrees, outward positive",
        from: SEPARATIONS[0],
        to: SEPARATIONS[1],
        logarithmic: false,
        ticks: vec![-60.0, -30.0, 0.0, 30.0, 60.0, 90.0, 120.0, 150.0],
        mark: rig.separation.deg(),
    };
    over_separation.draw(&mut svg, |degrees| ZonesOf { separation: Angle::from_deg(degrees), ..*rig });
    let over_radius = Diagram {
        left: LEFT + WIDTH + GAP,
        title: format!("baseline {:.0}, field {:.2}, separation {:.1}", rig.baseline, rig.field, rig.separation),
        axis: "radius of the circle in millimetres",
        from: nearest,
        to: FARTHEST_MM.max(2.0 * rig.radius.mm()),
        logarithmic: true,
        ticks: vec![100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0],
        mark: rig.radius.mm(),
    };
    over_radius.draw(&mut svg, |mm| ZonesOf { radius: Length::from_mm(mm), ..*rig });
    legend(&mut svg, tall - 16.0);
    svg.push_str("</svg>\n");
    svg
}

struct Diagram {
    left: f64,
    title: String,
    axis: &'static str,
    from: f64,
    to: f64,
    logarithmic: bool,
    ticks: Vec<f64>,
    mark: f64,
}

impl Diagram {
    fn draw(&self, svg: &mut String, rig_at: impl Fn(f64) -> ZonesOf) {
        self.frame(svg);
        let samples: Vec<(f64, ZonesOf)> = (0..=POINTS)
            .map(|i| self.value_at(f64::from(i) / f64::from(POINTS)))
            .map(|value| (value, rig_at(value)))
            .collect();
        for (_, colour, angle) in CURVES {
            let exact = samples.iter().map(|(value, rig)| (*value, rig.exact().map(|zones| angle(&zones))));
            self.curve(svg, exact, &format!("stroke=\"{colour}\" stroke-width=\"2.2\""));
            let paper = samples.iter().map(|(value, rig)| (*value, rig.paper().map(|zones| angle(&zones))));
            let dashed = format!("stroke=\"{colour}\" stroke-width=\"1.4\" stroke-dasharray=\"5 4\"");
            self.curve(svg, paper, &dashed);
        }
    }

    fn frame(&self, svg: &mut String) {
        let (left, right, bottom) = (self.left, self.left + WIDTH, TOP + HEIGHT);
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"14\">{}</text>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            left + WIDTH / 2.0,
            TOP - 16.0,
            self.title,
            left + WIDTH / 2.0,
            bottom + 38.0,
            self.axis
        );
        for degrees in (0..=360).step_by(60) {
            let y = height_of(f64::from(degrees));
            let _ = writeln!(
                svg,
                "<line x1=\"{left}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{degrees}°</text>",
                left - 6.0,
                y + 4.0
            );
        }
        for tick in self.ticks.iter().filter(|tick| (self.from..=self.to).contains(tick)) {
            let x = self.place_of(*tick);
            let _ = writeln!(
                svg,
                "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" stroke=\"#ddd\"/>\
                 <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{tick}</text>",
                bottom + 17.0
            );
        }
        if (self.from..=self.to).contains(&self.mark) {
            let x = self.place_of(self.mark);
            let _ =
                writeln!(svg, "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" stroke=\"#c1121f\"/>");
        }
    }

    /// Unbroken where there are values.
    fn curve(&self, svg: &mut String, points: impl Iterator<Item = (f64, Option<Angle>)>, style: &str) {
        let points: Vec<(f64, Option<Angle>)> = points.collect();
        for run in points.chunk_by(|a, b| a.1.is_some() == b.1.is_some()) {
            let line: Vec<String> = run
                .iter()
                .filter_map(|(value, angle)| Some((self.place_of(*value), height_of(angle.as_ref()?.deg()))))
                .map(|(x, y)| format!("{x:.1},{y:.1}"))
                .collect();
            if line.len() > 1 {
                let _ = writeln!(svg, "<polyline points=\"{}\" fill=\"none\" {style}/>", line.join(" "));
            }
        }
    }

    fn value_at(&self, share: f64) -> f64 {
        if self.logarithmic {
            self.from * (self.to / self.from).powf(share)
        } else {
            self.from + (self.to - self.from) * share
        }
    }

    fn place_of(&self, value: f64) -> f64 {
        let share = if self.logarithmic {
            (value / self.from).ln() / (self.to / self.from).ln()
        } else {
            (value - self.from) / (self.to - self.from)
        };
        self.left + WIDTH * share
    }
}

fn height_of(degrees: f64) -> f64 {
    TOP + HEIGHT * (1.0 - degrees / 360.0)
}

impl ZonesOf {
    /// Two equal cameras with the baseline, separation and mean field of `cameras`, on a circle of `radius`.
    #[must_use]
    pub fn like([left, right]: &[PlanarCamera; 2], radius: Length) -> Self {
        let [dx, dy] = [0, 1].map(|place| right.centre_mm[place] - left.centre_mm[place]);
        Self {
            baseline: Length::from_mm(dx.hypot(dy)),
            separation: right.axis - left.axis,
            field: left.half_field + right.half_field,
            radius,
        }
    }

    fn exact(&self) -> Option<Zones> {
        let cameras = symmetric_pair(self.baseline, self.separation, self.field);
        zones_exact(cameras, self.radius).ok().map(|map| map.zones)
    }

    fn paper(&self) -> Option<Zones> {
        paper_eq3_applies(self.field, self.separation, self.baseline, self.radius)
            .then(|| paper_eq3(self.field, self.separation, self.baseline, self.radius))
    }
}

fn legend(svg: &mut String, y: f64) {
    let mut x = LEFT;
    for (name, colour, _) in CURVES {
        let _ = writeln!(
            svg,
            "<line x1=\"{x}\" x2=\"{}\" y1=\"{1}\" y2=\"{1}\" stroke=\"{colour}\" stroke-width=\"2.2\"/>\
             <text x=\"{2}\" y=\"{y}\">{name}</text>",
            x + 26.0,
            y - 4.0,
            x + 32.0
        );
        x += 100.0;
    }
    let _ = writeln!(
        svg,
        "<text x=\"{x}\" y=\"{y}\" fill=\"#555\">solid: exact; dashed: equation 3 of the paper, in its domain</text>"
    );
}
