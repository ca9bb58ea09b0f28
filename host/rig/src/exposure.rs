//! Exposures of images in time, and the shutters of cameras.

use std::time::Duration;

use crate::clock::BoardInstant;

/// The shutter of a camera: how its sensor exposes the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Shutter {
    /// All rows are exposed at once.
    #[default]
    Global,
    /// The rows are exposed one after the other.
    Rolling {
        /// Time from the middle of one row's exposure to that of the next, in microseconds; negative where the image is
        /// read from the bottom.
        line_us: f64,
    },
}

impl Shutter {
    /// Time from the middle of one row's exposure to that of the next, in microseconds; zero for a global shutter.
    #[must_use]
    pub const fn line_us(self) -> f64 {
        match self {
            Self::Global => 0.0,
            Self::Rolling { line_us } => line_us,
        }
    }

    /// Time from the exposure of the first of `rows` rows to that of the last, whichever end is read first.
    #[must_use]
    pub fn span(self, rows: u32) -> Duration {
        let us = self.line_us().abs() * f64::from(rows.saturating_sub(1));
        Duration::from_nanos((us * 1e3).round() as u64)
    }
}

/// The exposure of one image in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// The middle of the exposure of the middle row, on the board's clock.
    pub middle: BoardInstant,
    /// The camera's shutter.
    pub shutter: Shutter,
    /// Number of rows of the image.
    pub rows: u32,
}

impl Exposure {
    /// The middle of the exposure of row `v`, on the board's clock. Its error bound is that of the image's instant.
    #[must_use]
    pub fn at_row(&self, v: f64) -> BoardInstant {
        let lines = v - 0.5 * (f64::from(self.rows) - 1.0);
        BoardInstant { us: self.middle.us + lines * self.shutter.line_us(), ..self.middle }
    }
}

/// The exposures of both images of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairExposure {
    /// Exposure of the left image.
    pub left: Exposure,
    /// Exposure of the right image.
    pub right: Exposure,
}
