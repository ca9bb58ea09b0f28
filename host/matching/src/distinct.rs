//! Whether a place looks like no other along its row.
//!
//! The ratio of descriptor distances compares with detected keypoints only: on a fence, tiles or a calibration board
//! the true partner may be missing among them while its neighbour is not. Normalised cross-correlation of the place
//! with everything its own view shows in the band finds such repetitions wherever they are.

use crate::ViewPixel;
use crate::plane::{Plane, Pyramid};

/// The level compared in: half the resolution shows a larger surrounding for less work.
const LEVEL: usize = 1;
const SCALE: f64 = (1 << LEVEL) as f64;
/// Half the window's side, in pixels of the level.
const HALF: usize = 7;
const SIDE: usize = 2 * HALF + 1;
/// A window whose values deviate by less, in grey levels, is flat: it looks like nothing.
const FLAT: f64 = 0.01;
/// Correlation from which two places look the same.
const ALIKE: f32 = 0.93;
/// Nearer than this, in pixels of the level, a place is the same one.
const SAME_PLACE: usize = 5;
/// How far off the row a repetition may lie, in pixels of the level.
const ROWS: usize = 1;

/// A view prepared for looking along its rows.
pub(crate) struct Surroundings<'a> {
    plane: &'a Plane,
    /// One over the norm of the window's deviations from its mean, by its centre; 0 where the window is flat or not all inside.
    inverse_norm: Plane,
}

impl<'a> Surroundings<'a> {
    /// `None` where the view is too small to have the level.
    pub(crate) fn of(pyramid: &'a Pyramid) -> Option<Self> {
        let plane = pyramid.levels().get(LEVEL)?;
        Some(Self { plane, inverse_norm: plane.like(|y, out| inverse_norms(plane, y, out)) })
    }

    /// Whether nothing between the columns `from` and `to` of the row of `at` looks like `at` but itself. All are in
    /// pixels of the view; what lies outside is not compared.
    pub(crate) fn is_distinct(&self, at: ViewPixel, from: f64, to: f64) -> bool {
        let whole = |position: f64| (position / SCALE).round().max(0.0) as usize;
        let (x, y) = (whole(at.x), whole(at.y));
        let Some(place) = window(self.plane, x, y) else { return true };
        let least_dot = ALIKE * norm(&place);
        let looks_alike = |column: usize, row: usize| self.dot(&place, column, row) > least_dot;
        let columns = whole(from).max(HALF)..(whole(to) + 1).min(self.plane.width().saturating_sub(HALF));
        let rows = y.saturating_sub(ROWS).max(HALF)..(y + ROWS + 1).min(self.plane.height().saturating_sub(HALF));
        !columns
            .filter(|column| column.abs_diff(x) > SAME_PLACE)
            .any(|column| rows.clone().any(|row| looks_alike(column, row)))
    }

    /// Product of a window without mean and the normalised window around a pixel that has one.
    fn dot(&self, place: &[f32; SIDE * SIDE], x: usize, y: usize) -> f32 {
        let mut sums = [0.0_f32; SIDE]; // by column, so that the compiler may vectorise
        for (j, line) in place.chunks_exact(SIDE).enumerate() {
            let other = &self.plane.row(y - HALF + j)[x - HALF..][..SIDE];
            sums.iter_mut().zip(line).zip(other).for_each(|((sum, p), q)| *sum += p * q);
        }
        sums.iter().sum::<f32>() * self.inverse_norm.at(x, y)
    }
}

/// For the windows around the pixels of row `y`: n σ² is the sum of squares less n times the squared mean.
fn inverse_norms(plane: &Plane, y: usize, out: &mut [f32]) {
    const COUNT: f64 = (SIDE * SIDE) as f64;
    let Some(first) = y.checked_sub(HALF).filter(|first| first + SIDE <= plane.height()) else { return };
    let mut columns = vec![[0.0_f64; 2]; plane.width()];
    for row in first..first + SIDE {
        for ([sum, squares], value) in columns.iter_mut().zip(plane.row(row)) {
            let value = f64::from(*value);
            *sum += value;
            *squares += value * value;
        }
    }
    for (window, out) in columns.windows(SIDE).zip(&mut out[HALF.min(plane.width())..]) {
        let [sum, squares] = window.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        let variance = squares / COUNT - (sum / COUNT).powi(2);
        *out = if variance > FLAT * FLAT { (variance * COUNT).sqrt().recip() as f32 } else { 0.0 };
    }
}

/// The window around a pixel, its mean taken away; `None` where it is not all inside.
fn window(plane: &Plane, x: usize, y: usize) -> Option<[f32; SIDE * SIDE]> {
    let (column, row) = (x.checked_sub(HALF)?, y.checked_sub(HALF)?);
    if x + HALF >= plane.width() || y + HALF >= plane.height() {
        return None;
    }
    let mut values = [0.0; SIDE * SIDE];
    for (j, line) in values.chunks_exact_mut(SIDE).enumerate() {
        line.copy_from_slice(&plane.row(row + j)[column..][..SIDE]);
    }
    let mean = values.iter().sum::<f32>() / (SIDE * SIDE) as f32;
    values.iter_mut().for_each(|value| *value -= mean);
    Some(values)
}

fn norm(values: &[f32; SIDE * SIDE]) -> f32 {
    values.iter().map(|value| value * value).sum::<f32>().sqrt()
}
