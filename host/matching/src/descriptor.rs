//! Descriptors of keypoints: histograms of the gradients around them.
//!
//! D. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 60(2), 2004, §6: 4 × 4 cells of 8
//! directions with trilinear interpolation, normalised, clipped at 0.2 and normalised again. They are upright and of
//! one scale per level, because both views are already resampled in the shared axes.

use multiversion::multiversion;

use crate::plane::Plane;

const CELLS: usize = 4;
const DIRECTIONS: usize = 8;
const LENGTH: usize = CELLS * CELLS * DIRECTIONS;
/// Side of a cell in pixels of the level: Lowe's three times the smoothing, here 1 px and that of the lens.
const CELL: f32 = 4.0;
/// Largest value of a bin (Lowe: 0.2), against non-linear changes of brightness.
const LARGEST: f32 = 0.2;
/// Half the window's side: (CELLS + 1) / 2 cells.
const REACH: usize = 10;
const SIDE: usize = 2 * REACH + 1;
/// Cells beside the outermost that gradients of the window touch; what they hold is left out.
const MARGIN: usize = 2;
/// Cells of a side with those.
const ALL: usize = CELLS + 2 * MARGIN;

/// A descriptor: a unit vector, or zero where there is no gradient.
#[derive(Clone, Debug)]
pub(crate) struct Descriptor([f32; LENGTH]);

impl Descriptor {
    /// Computes the descriptor at (x, y) of a smoothed level. Gradients outside count as zero.
    pub(crate) fn at(plane: &Plane, x: f64, y: f64) -> Self {
        let (column, row) = (x.round(), y.round());
        let (across, down) = (Axis::new((column - x) as f32), Axis::new((row - y) as f32));
        let mut all = [0.0; ALL * ALL * DIRECTIONS];
        for j in 0..SIDE {
            let y = row as isize + j as isize - REACH as isize;
            let (gx, gy) = gradients(plane, column as isize - REACH as isize, y);
            let (mut magnitude, mut turn) = ([0.0; SIDE], [0.0; SIDE]);
            polar([&gx, &gy], &across.weight, [&mut magnitude, &mut turn]);
            add(&mut all, [&magnitude, &turn], &across, (down.cell[j], down.past[j], down.weight[j]));
        }
        let mut histogram = [0.0; LENGTH];
        for (j, line) in histogram.chunks_exact_mut(CELLS * DIRECTIONS).enumerate() {
            line.copy_from_slice(&all[((j + MARGIN) * ALL + MARGIN) * DIRECTIONS..][..CELLS * DIRECTIONS]);
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

/// Where the pixels of the window lie along one axis.
struct Axis {
    /// The first of the two cells that share a pixel, counted from the margin.
    cell: [usize; SIDE],
    /// Part of the pixel that belongs to the second.
    past: [f32; SIDE],
    /// A Gaussian whose sigma is half the window's width, two cells.
    weight: [f32; SIDE],
}

impl Axis {
    /// The window around a position that is `off` pixels before its middle pixel.
    fn new(off: f32) -> Self {
        let cells = |i: usize| (i as f32 - REACH as f32 + off) / CELL;
        let place = |i: usize| cells(i) + (CELLS as f32 - 1.0) / 2.0 + MARGIN as f32;
        Self {
            cell: std::array::from_fn(|i| place(i) as usize),
            past: std::array::from_fn(|i| place(i).fract()),
            weight: std::array::from_fn(|i| (-0.125 * cells(i) * cells(i)).exp()),
        }
    }
}

/// Adds the gradients of one row, with their lengths and turns, to their cells and directions. The row lies in the cell `row`, in
/// the next one by the part `past`, and counts by `weight`.
fn add(
    all: &mut [f32; ALL * ALL * DIRECTIONS],
    [magnitude, turn]: [&[f32; SIDE]; 2],
    across: &Axis,
    (row, past, weight): (usize, f32, f32),
) {
    for i in 0..SIDE {
        // Turns are not negative, and a conversion to few bits is quick.
        let whole = turn[i] as u8;
        let (direction, beyond) = (usize::from(whole) % DIRECTIONS, turn[i] - f32::from(whole));
        let next = (direction + 1) % DIRECTIONS;
        let magnitude = magnitude[i] * weight;
        for (j, wj) in [(row, 1.0 - past), (row + 1, past)] {
            for (i, wi) in [(across.cell[i], 1.0 - across.past[i]), (across.cell[i] + 1, across.past[i])] {
                let Some(cell) = all.get_mut((j * ALL + i) * DIRECTIONS..).and_then(<[f32]>::first_chunk_mut) else {
                    continue;
                };
                let cell: &mut [f32; DIRECTIONS] = cell;
                let part = magnitude * wj * wi;
                cell[direction] += part * (1.0 - beyond);
                cell[next] += part * beyond;
            }
        }
    }
}

/// Lengths of gradients, times `weight`, and their directions in parts of a turn, from 0 up to the number of directions.
///
/// The arc tangent is the polynomial 4.4.49 of M. Abramowitz and I. Stegun, *Handbook of Mathematical Functions*, 1964: right to 2e-8.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn polar([gx, gy]: [&[f32; SIDE]; 2], weight: &[f32; SIDE], [magnitude, turn]: [&mut [f32; SIDE]; 2]) {
    use std::f32::consts::{FRAC_PI_2, PI, TAU};
    const SERIES: [f32; 9] = [
        1.0,
        -0.333_331_45,
        0.199_935_5,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_614,
        -0.016_165_737,
        0.002_866_225_7,
    ];
    for i in 0..SIDE {
        let (x, y) = (gx[i].abs(), gy[i].abs());
        let tangent = x.min(y) / x.max(y).max(f32::MIN_POSITIVE);
        let squared = tangent * tangent;
        let acute = tangent * SERIES.iter().rev().fold(0.0, |sum, term| sum * squared + term);
        let first = if y > x { FRAC_PI_2 - acute } else { acute };
        let upper = if gx[i] < 0.0 { PI - first } else { first };
        let angle = if gy[i] < 0.0 { TAU - upper } else { upper };
        magnitude[i] = (gx[i] * gx[i] + gy[i] * gy[i]).sqrt() * weight[i];
        turn[i] = angle * (DIRECTIONS as f32 / TAU);
    }
}

/// Central differences in row y from column x on; zero at and beyond the border.
fn gradients(plane: &Plane, x: isize, y: isize) -> ([f32; SIDE], [f32; SIDE]) {
    let (mut gx, mut gy) = ([0.0; SIDE], [0.0; SIDE]);
    let Some(row) = usize::try_from(y).ok().filter(|row| *row > 0 && row + 1 < plane.height()) else { return (gx, gy) };
    let (above, here, below) = (plane.row(row - 1), plane.row(row), plane.row(row + 1));
    for i in 0..SIDE {
        let Some(column) = x.checked_add_unsigned(i).and_then(|column| usize::try_from(column).ok()) else { continue };
        if column == 0 || column + 1 >= plane.width() {
            continue;
        }
        (gx[i], gy[i]) = (here[column + 1] - here[column - 1], below[column] - above[column]);
    }
    (gx, gy)
}

fn normalise(histogram: &mut [f32; LENGTH]) {
    let norm = histogram.iter().map(|h| h * h).sum::<f32>().sqrt();
    if norm > 0.0 {
        histogram.iter_mut().for_each(|h| *h /= norm);
    }
}
