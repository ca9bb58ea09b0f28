//! Descriptors of keypoints: histograms of the gradients around them.
//!
//! D. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 60(2), 2004, §6: 4 × 4 cells of 8
//! directions with trilinear interpolation, normalised, clipped at 0.2 and normalised again. They are upright and of
//! one scale per level, because both views are already resampled in the shared axes.

use crate::plane::Plane;

const CELLS: usize = 4;
const DIRECTIONS: usize = 8;
const LENGTH: usize = CELLS * CELLS * DIRECTIONS;
/// Side of a cell in pixels of the level: Lowe's three times the smoothing, here 1 px and that of the lens.
const CELL: f64 = 4.0;
/// Largest value of a bin (Lowe: 0.2), against non-linear changes of brightness.
const LARGEST: f32 = 0.2;

/// A descriptor: a unit vector, or zero where there is no gradient.
#[derive(Clone, Debug)]
pub(crate) struct Descriptor([f32; LENGTH]);

impl Descriptor {
    /// Computes the descriptor at (x, y) of a smoothed level. Gradients outside count as zero.
    pub(crate) fn at(plane: &Plane, x: f64, y: f64) -> Self {
        const REACH: isize = 10; // (CELLS + 1) / 2 cells
        let mut histogram = [0.0; LENGTH];
        let (column, row) = (x.round(), y.round());
        for j in -REACH..=REACH {
            for i in -REACH..=REACH {
                let Some((gx, gy)) = gradient(plane, column as isize + i, row as isize + j) else { continue };
                let (dx, dy) = (column + i as f64 - x, row + j as f64 - y);
                add(&mut histogram, dx / CELL, dy / CELL, gx, gy);
            }
        }
        normalise(&mut histogram);
        histogram.iter_mut().for_each(|h| *h = h.min(LARGEST));
        normalise(&mut histogram);
        Self(histogram)
    }

    /// Squared Euclidean distance: 0 for equal surroundings, about 1 and more for unrelated ones.
    pub(crate) fn distance_squared(&self, other: &Self) -> f32 {
        const LANES: usize = 16; // independent sums, so that the compiler may vectorise
        let mut sums = [0.0_f32; LANES];
        for (p, q) in self.0.chunks_exact(LANES).zip(other.0.chunks_exact(LANES)) {
            for ((sum, a), b) in sums.iter_mut().zip(p).zip(q) {
                *sum += (a - b) * (a - b);
            }
        }
        sums.iter().sum()
    }
}

/// Adds a gradient at (u, v) cells from the centre to its cells and directions.
fn add(histogram: &mut [f32; LENGTH], u: f64, v: f64, gx: f32, gy: f32) {
    let magnitude = gx.hypot(gy);
    // A Gaussian whose sigma is half the window's width, two cells.
    let weight = magnitude * (-0.125 * (u * u + v * v) as f32).exp();
    let turn = f64::from(gy.atan2(gx)) * (DIRECTIONS as f64 / std::f64::consts::TAU);
    let centre = (CELLS as f64 - 1.0) / 2.0;
    for (j, wj) in shares(v + centre) {
        for (i, wi) in shares(u + centre) {
            if !(0..CELLS as isize).contains(&i) || !(0..CELLS as isize).contains(&j) {
                continue;
            }
            let cell = (j as usize * CELLS + i as usize) * DIRECTIONS;
            for (k, wk) in shares(turn) {
                histogram[cell + k.rem_euclid(DIRECTIONS as isize) as usize] += weight * wj * wi * wk;
            }
        }
    }
}

/// The two bins next to a coordinate with their linear weights.
fn shares(coordinate: f64) -> [(isize, f32); 2] {
    let floor = coordinate.floor();
    let past = (coordinate - floor) as f32;
    [(floor as isize, 1.0 - past), (floor as isize + 1, past)]
}

/// The gradient by central differences; `None` at and beyond the border.
fn gradient(plane: &Plane, x: isize, y: isize) -> Option<(f32, f32)> {
    let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
    if x == 0 || y == 0 || x + 1 >= plane.width() || y + 1 >= plane.height() {
        return None;
    }
    Some((plane.at(x + 1, y) - plane.at(x - 1, y), plane.at(x, y + 1) - plane.at(x, y - 1)))
}

fn normalise(histogram: &mut [f32; LENGTH]) {
    let norm = histogram.iter().map(|h| h * h).sum::<f32>().sqrt();
    if norm > 0.0 {
        histogram.iter_mut().for_each(|h| *h /= norm);
    }
}
