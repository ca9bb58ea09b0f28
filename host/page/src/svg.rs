//! Drawings in SVG, with short numbers and without any that are not finite.

use std::fmt::Write as _;

use crate::text::escape;

/// An SVG drawing; x points to the right, y down.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    width: f64,
    height: f64,
    body: String,
}

/// The part of a text that is at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The left end.
    Start,
    /// The middle.
    Middle,
    /// The right end.
    End,
}

impl Drawing {
    /// Makes an empty drawing.
    #[must_use]
    pub const fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// The width of the drawing.
    #[must_use]
    pub const fn width(&self) -> f64 {
        self.width
    }

    /// The height of the drawing.
    #[must_use]
    pub const fn height(&self) -> f64 {
        self.height
    }

    /// Draws `path` with the CSS class `class`; `style` may be empty.
    pub fn path(&mut self, path: &Path, class: &str, style: &str) {
        if !path.0.is_empty() {
            let style = if style.is_empty() { String::new() } else { format!(" style=\"{style}\"") };
            self.push(format_args!("<path class=\"{class}\"{style} d=\"{}\"/>", path.0));
        }
    }

    /// Draws a straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], class: &str) {
        self.path(&Path::through(&[from, to]), class, "");
    }

    /// Draws a rectangle, given by its upper left corner and its size.
    pub fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], class: &str, style: &str) {
        let corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
        let mut path = Path::default();
        path.polygon(&corners);
        self.path(&path, class, style);
    }

    /// A picture, already a data URL, that fills the rectangle from its upper left corner.
    pub fn image(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], data: &str) {
        let ([x, y, width, height], data) = ([x, y, width, height].map(short), escape(data));
        self.push(format_args!("<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" href=\"{data}\"/>"));
    }

    /// Draws one line of text with its baseline at a position.
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

    /// Draws a text that reads upwards.
    pub fn text_upwards(&mut self, [x, y]: [f64; 2], class: &str, text: &str) {
        let (x, y, text) = (short(x), short(y), escape(text));
        let place = format_args!("transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\"").to_string();
        self.push(format_args!("<text class=\"{class}\" {place}>{text}</text>"));
    }

    /// Runs `draw` and clips its result at a rectangle, given by its upper left corner and its size.
    pub fn clipped(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], draw: impl FnOnce(&mut Self)) {
        let [left, top, wide, high] = [x, y, width, height].map(short);
        // A nested drawing clips at its border and needs no identifier, which would have to be unique in the page.
        let place = format!("x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{high}\"");
        self.push(format_args!("<svg {place} viewBox=\"{left} {top} {wide} {high}\">"));
        draw(self);
        self.push(format_args!("</svg>"));
    }

    /// Prints the SVG element; `label` is its text for screen readers.
    #[must_use]
    pub fn svg(&self, label: &str) -> String {
        let (width, height, label) = (short(self.width), short(self.height), escape(label));
        format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">\n{}</svg>", self.body)
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{element}");
    }
}

/// The data of a path. Parts with a coordinate that is not finite are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Path(String);

impl Path {
    /// Makes a path of one open line.
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

    /// Adds a dot, for lines with round ends; it is as large as the line is wide.
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

    /// Adds a line with an arrow head at its end.
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

/// Prints a number to a tenth, in as few characters as possible.
fn short(x: f64) -> String {
    let text = format!("{x:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}
