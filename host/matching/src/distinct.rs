//! Detection of repeated patterns along a row.
//!
//! The ratio of descriptor distances compares detected keypoints only: on a fence, on tiles or on a calibration target
//! the true partner may be missing among them while its neighbour is not. Normalised cross-correlation of the window
//! around a position with all windows of its own view in the epipolar band finds such repetitions everywhere.

use std::ops::Range;

use multiversion::multiversion;

use crate::ViewPixel;
use crate::plane::{Plane, Pyramid};

/// Pyramid level of the comparison: half the resolution covers larger surroundings for less work.
const LEVEL: usize = 1;
const SCALE: f64 = (1 << LEVEL) as f64;
/// Half the window's side, in pixels of the level.
const HALF: usize = 7;
const SIDE: usize = 2 * HALF + 1;
/// Standard deviation in grey levels below which a window counts as flat and is not compared.
const FLAT: f64 = 0.01;
/// Correlation above which two windows count as the same pattern.
const ALIKE: f32 = 0.93;
/// Number of columns compared in one step.
const TOGETHER: usize = 16;
/// Distance in pixels of the level up to which two positions count as one.
const SAME_PLACE: usize = 5;
/// Largest distance of a repetition from the row, in pixels of the level.
const ROWS: usize = 1;
/// Rows of the level that are prepared beside those that are asked for: partners lie that far off the row.
const BESIDE: usize = 16;

/// The values of the window around a pixel, by rows.
type Window = [f32; SIDE * SIDE];

/// A view prepared for the search along its rows.
pub(crate) struct Surroundings<'a> {
    plane: &'a Plane,
    /// One over the norm of each window's deviations from its mean, by its centre; 0 where the window is flat or not
    /// all inside.
    inverse_norm: Plane,
}

impl<'a> Surroundings<'a> {
    /// Prepares a view; `None` where it is too small to have the level.
    pub(crate) fn of(pyramid: &'a Pyramid) -> Option<Self> {
        Self::within(pyramid, 0..usize::MAX)
    }

    /// Prepares some rows of a view. In the others nothing is found to repeat.
    pub(crate) fn within(pyramid: &'a Pyramid, rows: Range<usize>) -> Option<Self> {
        let plane = pyramid.levels().get(LEVEL)?;
        let rows = (rows.start >> LEVEL).saturating_sub(BESIDE)..(rows.end >> LEVEL).saturating_add(BESIDE);
        let prepare = |y: usize, out: &mut [f32]| {
            if rows.contains(&y) {
                inverse_norms(plane, y, out);
            }
        };
        Some(Self { plane, inverse_norm: plane.like(prepare) })
    }

    /// Whether no other position between the columns `from` and `to`, in the row of `at`, shows the same pattern as
    /// `at`. Columns are in pixels of the view; those outside are not compared.
    pub(crate) fn is_distinct(&self, at: ViewPixel, from: f64, to: f64) -> bool {
        let whole = |position: f64| (position / SCALE).round().max(0.0) as usize;
        let (x, y) = (whole(at.x), whole(at.y));
        let Some(place) = window(self.plane, x, y).and_then(normalised) else { return true };
        let columns = whole(from).max(HALF)..(whole(to) + 1).min(self.plane.width().saturating_sub(HALF));
        let rows = y.saturating_sub(ROWS).max(HALF)..(y + ROWS + 1).min(self.plane.height().saturating_sub(HALF));
        let before = columns.start..columns.end.min(x.saturating_sub(SAME_PLACE));
        let after = columns.start.max(x + SAME_PLACE + 1)..columns.end;
        ![before, after].into_iter().any(|columns| rows.clone().any(|row| self.shows(&place, row, columns.clone())))
    }

    /// Whether the window of one of `columns` in row `y` shows the same pattern as `place`, a window with zero mean and
    /// norm 1. All columns must have a window.
    fn shows(&self, place: &Window, y: usize, columns: Range<usize>) -> bool {
        let lines = std::array::from_fn(|j| self.plane.row(y - HALF + j));
        shows(place, &lines, self.inverse_norm.row(y), columns)
    }
}

/// The loop of [`Surroundings::shows`], many columns at a time.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn shows(place: &Window, lines: &[&[f32]; SIDE], inverse_norms: &[f32], columns: Range<usize>) -> bool {
    let Some(last) = inverse_norms.len().checked_sub(HALF + TOGETHER).filter(|last| *last >= HALF) else {
        return false;
    };
    columns.clone().step_by(TOGETHER).any(|first| {
        // Near the border some columns are compared twice.
        let first = first.min(last);
        let mut sums = [0.0_f32; TOGETHER];
        for (weights, line) in place.chunks_exact(SIDE).zip(lines) {
            let around = &line[first - HALF..][..TOGETHER + SIDE - 1];
            for (i, weight) in weights.iter().enumerate() {
                sums.iter_mut().zip(&around[i..]).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        let alike = sums.iter().zip(&inverse_norms[first..]).enumerate();
        let mut alike = alike.filter(|(_, (sum, inverse_norm))| *sum * *inverse_norm > ALIKE);
        alike.any(|(k, _)| columns.contains(&(first + k)))
    })
}

/// Computes [`Surroundings::inverse_norm`] for row `y`: n σ² is the sum of squares less n times the squared mean.
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
    let (mut sum, mut squares) = (0.0, 0.0);
    for (x, [new_sum, new_squares]) in columns.iter().enumerate() {
        sum += new_sum;
        squares += new_squares;
        let Some(left) = (x + 1).checked_sub(SIDE) else { continue };
        let variance = squares / COUNT - (sum / COUNT).powi(2);
        out[left + HALF] = if variance > FLAT * FLAT { (variance * COUNT).sqrt().recip() as f32 } else { 0.0 };
        sum -= columns[left][0];
        squares -= columns[left][1];
    }
}

/// The window around a pixel less its mean; `None` where it is not all inside.
fn window(plane: &Plane, x: usize, y: usize) -> Option<Window> {
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

/// Scales a window of zero mean to norm 1; `None` where it is flat.
fn normalised(window: Window) -> Option<Window> {
    let norm = window.iter().map(|value| value * value).sum::<f32>().sqrt();
    (f64::from(norm) > FLAT * SIDE as f64).then(|| window.map(|value| value / norm))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat window has no pattern that could repeat, such as an overexposed sky.
    #[test]
    fn a_flat_surface_repeats_nothing() {
        const SIZE: usize = 160;
        let textured = |x: usize, y: usize| (x < 80).then(|| 128.0 + 60.0 * ((x * x + 3 * y) as f32 * 0.05).sin());
        let values = (0..SIZE * SIZE).map(|i| textured(i % SIZE, i / SIZE).unwrap_or(254.7)).collect();
        let pyramid = Pyramid::new(&Plane::new(SIZE, SIZE, values), 2);
        let surroundings = Surroundings::of(&pyramid).unwrap();
        for y in (30..130).step_by(4) {
            let at = ViewPixel { x: 50.0, y: f64::from(y) };
            assert!(surroundings.is_distinct(at, 104.0, 140.0), "{y}");
        }
        // A repeated pattern is found.
        let tiled = (0..SIZE * SIZE).map(|i| if (i % SIZE % 40 < 20) == (i / SIZE % 40 < 20) { 200.0 } else { 50.0 });
        let pyramid = Pyramid::new(&Plane::new(SIZE, SIZE, tiled.collect()), 2);
        assert!(!Surroundings::of(&pyramid).unwrap().is_distinct(ViewPixel { x: 40.0, y: 80.0 }, 60.0, 140.0));
    }
}
