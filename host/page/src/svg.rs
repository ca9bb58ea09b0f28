//! Drawings: a thin layer over SVG that writes short numbers and never a number that is none.

use std::fmt::Write as _;

use crate::html::escape;

/// A drawing; x to the right, y down.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    width: f64,
    height: f64,
    body: String,
}

/// Which side of its place a text ends at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

impl Drawing {
    /// An empty one.
    #[must_use]
    pub const fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// As given.
    #[must_use]
    pub const fn width(&self) -> f64 {
        self.width
    }

    /// As given.
    #[must_use]
    pub const fn height(&self) -> f64 {
        self.height
    }

    /// An element of `class` along `path`, which [`Path`] made; `style` may be empty.
    pub fn path(&mut self, path: &Path, class: &str, style: &str) {
        if !path.0.is_empty() {
            let style = if style.is_empty() { String::new() } else { format!(" style=\"{style}\"") };
            self.push(format_args!("<path class=\"{class}\"{style} d=\"{}\"/>", path.0));
        }
    }

    /// A straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], class: &str) {
        self.path(&Path::through(&[from, to]), class, "");
    }

    /// The rectangle from its upper left corner.
    pub fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], class: &str, style: &str) {
        let corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
        let mut path = Path::default();
        path.polygon(&corners);
        self.path(&path, class, style);
    }

    /// One line of text on its baseline.
    pub fn text(&mut self, [x, y]: [f64; 2], anchor: Anchor, class: &str, text: &str) {
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y, text) = (short(x), short(y), escape(text));
        self.push(format_args!("<text class=\"{class}\" x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>"));
    }

    /// A text that reads upwards.
    pub fn text_upwards(&mut self, [x, y]: [f64; 2], class: &str, text: &str) {
        let (x, y, text) = (short(x), short(y), escape(text));
        let place = format_args!("transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\"").to_string();
        self.push(format_args!("<text class=\"{class}\" {place}>{text}</text>"));
    }

    /// Draws what `draw` draws, cut at the rectangle from its upper left corner.
    pub fn clipped(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], draw: impl FnOnce(&mut Self)) {
        let [left, top, wide, high] = [x, y, width, height].map(short);
        // An inner drawing cuts at its border, and needs no name that the page must keep unique.
        let place = format!("x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{high}\"");
        self.push(format_args!("<svg {place} viewBox=\"{left} {top} {wide} {high}\">"));
        draw(self);
        self.push(format_args!("</svg>"));
    }

    /// The element; `label` is for those who cannot see it.
    #[must_use]
    pub fn svg(&self, label: &str) -> String {
        let (width, height, label) = (short(self.width), short(self.height), escape(label));
        format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">\n{}</svg>", self.body)
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "{element}");
    }
}

/// The data of a path. Parts with a coordinate that is not a finite number are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Path(String);

impl Path {
    /// An open line.
    #[must_use]
    pub fn through(points: &[[f64; 2]]) -> Self {
        let mut path = Self::default();
        path.line(points);
        path
    }

    /// Adds an open line.
    pub fn line(&mut self, points: &[[f64; 2]]) {
        if points.iter().flatten().all(|x| x.is_finite()) {
            for (i, [x, y]) in points.iter().enumerate() {
                let command = if i == 0 { 'M' } else { 'L' };
                let _ = write!(self.0, "{command}{} {}", short(*x), short(*y));
            }
        }
    }

    /// Adds a closed line.
    pub fn polygon(&mut self, points: &[[f64; 2]]) {
        if !points.is_empty() && points.iter().flatten().all(|x| x.is_finite()) {
            self.line(points);
            self.0.push('Z');
        }
    }

    /// A dot as large as the line is wide, for lines with round ends.
    pub fn dot(&mut self, [x, y]: [f64; 2]) {
        if x.is_finite() && y.is_finite() {
            let _ = write!(self.0, "M{} {}h0", short(x), short(y));
        }
    }

    /// Adds a diagonal cross.
    pub fn cross(&mut self, [x, y]: [f64; 2], half: f64) {
        self.line(&[[x - half, y - half], [x + half, y + half]]);
        self.line(&[[x - half, y + half], [x + half, y - half]]);
    }

    /// A line with a head at its end.
    pub fn arrow(&mut self, from: [f64; 2], by: [f64; 2]) {
        const HEAD: f64 = 4.5;
        let length = by[0].hypot(by[1]);
        let to = [from[0] + by[0], from[1] + by[1]];
        self.line(&[from, to]);
        if length > HEAD {
            let [x, y] = by.map(|b| b / length * HEAD);
            let barb = |side: f64| [to[0] - 0.8 * x - side * 0.45 * y, to[1] - 0.8 * y + side * 0.45 * x];
            self.line(&[barb(1.0), to, barb(-1.0)]);
        }
    }
}

/// To a tenth, without needless characters.
fn short(x: f64) -> String {
    let text = format!("{x:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
