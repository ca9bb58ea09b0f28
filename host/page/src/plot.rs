//! Axes of plots, with ticks at round numbers.

use crate::svg::{Anchor, Drawing};
use crate::text::fixed;

/// The axes of a plot: their ranges and their area in the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Lowest and highest value of the horizontal axis.
    pub x: [f64; 2],
    /// Lowest and highest value of the vertical axis.
    pub y: [f64; 2],
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

impl Axes {
    /// Makes axes that fill `drawing`, less the margins for labels.
    #[must_use]
    pub fn filling(drawing: &Drawing, x: [f64; 2], y: [f64; 2]) -> Self {
        const LEFT: f64 = 56.0;
        const BOTTOM: f64 = 46.0;
        const MARGIN: f64 = 12.0;
        let (width, height) = (drawing.width() - LEFT - MARGIN, drawing.height() - BOTTOM - MARGIN);
        Self { x, y, left: LEFT, top: MARGIN, width, height }
    }

    /// Converts values to a position in the drawing.
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
        [self.left + self.width * share(x, self.x), self.top + self.height * (1.0 - share(y, self.y))]
    }

    /// The upper left corner of the plot area in the drawing.
    #[must_use]
    pub const fn corner(&self) -> [f64; 2] {
        [self.left, self.top]
    }

    /// Width and height of the plot area in the drawing.
    #[must_use]
    pub const fn extent(&self) -> [f64; 2] {
        [self.width, self.height]
    }

    /// Draws the grid, the numbers and the names of both axes.
    pub fn draw(&self, drawing: &mut Drawing, x_name: &str, y_name: &str) {
        let (bottom, right) = (self.top + self.height, self.left + self.width);
        let (x_step, y_step) = (round_step(self.x[1] - self.x[0], 9.0), round_step(self.y[1] - self.y[0], 6.0));
        for tick in ticks(self.x, x_step) {
            let [x, _] = self.at(tick, 0.0);
            drawing.line([x, self.top], [x, bottom], "grid");
            drawing.text([x, bottom + 17.0], Anchor::Middle, "tick", &tick_label(tick, x_step));
        }
        for tick in ticks(self.y, y_step) {
            let [_, y] = self.at(0.0, tick);
            drawing.line([self.left, y], [right, y], "grid");
            drawing.text([self.left - 7.0, y + 4.0], Anchor::End, "tick", &tick_label(tick, y_step));
        }
        drawing.line([self.left, bottom], [right, bottom], "axis");
        drawing.text([self.left + 0.5 * self.width, bottom + 38.0], Anchor::Middle, "name", x_name);
        drawing.text_upwards([13.0, self.top + 0.5 * self.height], "name", y_name);
    }
}

/// The round number (1, 2 or 5 times a power of ten) that divides `span` into `parts` or slightly fewer.
#[must_use]
pub fn round_step(span: f64, parts: f64) -> f64 {
    let wanted = (span / parts).max(f64::MIN_POSITIVE);
    let power = 10f64.powf(wanted.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power).into_iter().find(|step| *step >= 0.999 * wanted).unwrap_or(wanted)
}

/// The multiples of `step` in the range.
fn ticks([low, high]: [f64; 2], step: f64) -> Vec<f64> {
    const MOST: u32 = 40;
    let first = (low / step - 1e-9).ceil();
    (0..MOST).map(|i| (first + f64::from(i)) * step).take_while(|tick| *tick <= high + 1e-9 * step).collect()
}

fn tick_label(tick: f64, step: f64) -> String {
    fixed(tick, (-(step * 1.001).log10().floor()) as i32)
}
