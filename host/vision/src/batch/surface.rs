//! B-spline surfaces of shifts in a plane, many places at once.
//!
//! Each interval of the grid is a polynomial: the four powers along the one axis of the four along the other, both coordinates of the shift in one
//! vector.

use super::lanes::{columns_of, multiply_add};
use crate::SplineGrid;

/// Powers along an axis.
const POWERS: usize = 4;
/// Both coordinates of the powers across.
const ROW: usize = 2 * POWERS;
/// Added to a number below 2³², it leaves the number itself in the lowest bits.
const INTEGER: f64 = 4_503_599_627_370_496.0;

/// The powers, by columns, of each of the control points that act in an interval: of x from 0 to 1, and of x from -1/2 to 1/2.
const CUBIC: [[f64; POWERS]; POWERS] = [
    [1.0 / 6.0, -0.5, 0.5, -1.0 / 6.0],
    [4.0 / 6.0, 0.0, -1.0, 0.5],
    [1.0 / 6.0, 0.5, 0.5, -0.5],
    [0.0, 0.0, 0.0, 1.0 / 6.0],
];
const QUADRATIC: [[f64; POWERS]; POWERS] =
    [[0.125, -0.5, 0.5, 0.0], [0.75, 0.0, -1.0, 0.0], [0.125, 0.5, 0.5, 0.0], [0.0; POWERS]];

type Cell = [[f64; ROW]; POWERS];

/// A surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface {
    middle: [f64; 2],
    per_unit: f64,
    /// Of each axis: what a place is from the middle of the grid, the first and last interval by their numbers, and what is added before a number
    /// is cut off.
    half: [f64; 2],
    last: [f64; 2],
    edges: [[f64; 2]; 2],
    rounding: f64,
    cells: Vec<Cell>,
}

/// Where places lie on a surface.
pub(super) struct OnSurface<const W: usize> {
    cell: [usize; W],
    /// Within the interval.
    at: [[f64; W]; 2],
    /// Intervals of the grid to the nearest edge; negative outside.
    pub inside: [f64; W],
}

/// Shifts, and the derivatives of the first, then of the second coordinate of the shift.
pub(super) type Shifted<const W: usize> = ([[f64; W]; 2], [[[f64; W]; 2]; 2]);

impl Surface {
    /// The surface about `middle` with these control points, row by row.
    pub(super) fn new(grid: SplineGrid, per_unit: f64, middle: [f64; 2], control: &[[f64; 2]]) -> Self {
        let SplineGrid { order, columns, rows, .. } = grid;
        let (basis, short) = if order == 3 { (&CUBIC, 3.0) } else { (&QUADRATIC, 2.0) };
        let counts = [columns as f64, rows as f64];
        let cell = |top: usize, left: usize| {
            let mut cell = Cell::default();
            for (row, column) in (0..=order).flat_map(|row| (0..=order).map(move |column| (row, column))) {
                let Some(point) = control.get((top + row) * columns + left + column) else { continue };
                for (down, across, axis) in powers() {
                    cell[down][2 * across + axis] += basis[row][down] * basis[column][across] * point[axis];
                }
            }
            cell
        };
        let cells = (0..rows.saturating_sub(order))
            .flat_map(|top| (0..columns.saturating_sub(order)).map(move |left| (top, left)))
            .map(|(top, left)| cell(top, left))
            .collect();
        let low = 0.5 * (short - 1.0);
        Self {
            middle,
            per_unit,
            half: counts.map(|count| 0.5 * (count - 1.0)),
            last: counts.map(|count| count - short),
            edges: counts.map(|count| [low, count - 1.0 - low]),
            rounding: if order == 3 { 0.0 } else { 0.5 },
            cells,
        }
    }

    /// Where places are on the surface; those outside are on the interval at its edge, which goes on.
    #[inline(always)]
    pub(super) fn places<const FUSED: bool, const W: usize>(&self, at: &[[f64; W]; 2]) -> OnSurface<W> {
        let mut found = OnSurface { cell: [0; W], at: *at, inside: [f64::INFINITY; W] };
        let mut number = [[0.0; W]; 2];
        for axis in 0..2 {
            let ([low, high], last) = (self.edges[axis], self.last[axis]);
            for j in 0..W {
                let place = multiply_add::<FUSED>(at[axis][j] - self.middle[axis], self.per_unit, self.half[axis]);
                let nearer = if place - low < high - place { place - low } else { high - place };
                // What is no number is outside.
                let nearer = if place.is_nan() { -1.0 } else { nearer };
                found.inside[j] = if nearer < found.inside[j] { nearer } else { found.inside[j] };
                let start = (place + self.rounding).floor();
                let start = if start < last { start } else { last };
                let start = if start > 1.0 { start } else { 1.0 };
                found.at[axis][j] = place - start;
                number[axis][j] = start - 1.0;
            }
        }
        for j in 0..W {
            let number = multiply_add::<FUSED>(number[1][j], self.last[0], number[0][j]);
            found.cell[j] = ((number + INTEGER).to_bits() & 0xFFFF_FFFF) as usize;
        }
        found
    }

    /// The place itself, or the nearest one on the surface.
    pub(super) fn kept(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [low, high] = self.edges[axis].map(|edge| (edge - self.half[axis]) / self.per_unit + self.middle[axis]);
            at[axis].clamp(low, high)
        })
    }

    /// Shifts.
    #[inline(always)]
    pub(super) fn shifts<const FUSED: bool, const W: usize>(&self, at: &OnSurface<W>) -> [[f64; W]; 2] {
        let mut sums = [[0.0; ROW]; W];
        // One place at a time: vectors over places would gather the numbers of their cells one by one.
        for (j, found) in sums.iter_mut().enumerate() {
            // Never absent: places are kept on the grid.
            let Some([a, b, c, d]) = self.cells.get(at.cell[j]) else { break };
            let mut sum = *d;
            for row in [c, b, a] {
                for i in 0..ROW {
                    sum[i] = multiply_add::<FUSED>(sum[i], at.at[1][j], row[i]);
                }
            }
            *found = sum;
        }
        across::<FUSED, W>(&columns_of(&sums), &at.at[0])
    }

    /// Shifts with their derivatives.
    #[inline(always)]
    pub(super) fn shifts_with_slopes<const FUSED: bool, const W: usize>(&self, at: &OnSurface<W>) -> Shifted<W> {
        let (mut sums, mut steeper) = ([[0.0; ROW]; W], [[0.0; ROW]; W]);
        for j in 0..W {
            let Some([a, b, c, d]) = self.cells.get(at.cell[j]) else { break };
            let (mut sum, mut slope) = (*d, [0.0; ROW]);
            for row in [c, b, a] {
                for i in 0..ROW {
                    slope[i] = multiply_add::<FUSED>(slope[i], at.at[1][j], sum[i]);
                    sum[i] = multiply_add::<FUSED>(sum[i], at.at[1][j], row[i]);
                }
            }
            (sums[j], steeper[j]) = (sum, slope);
        }
        let (sums, x) = (columns_of(&sums), &at.at[0]);
        let (shifts, by_y) = (across::<FUSED, W>(&sums, x), across::<FUSED, W>(&columns_of(&steeper), x));
        let by_x = slopes_across::<FUSED, W>(&sums, x);
        let mut slopes = [[by_x[0], by_y[0]], [by_x[1], by_y[1]]];
        for slope in slopes.as_flattened_mut() {
            for value in slope {
                *value *= self.per_unit;
            }
        }
        (shifts, slopes)
    }
}

/// All powers along both axes, for both coordinates.
fn powers() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..POWERS).flat_map(|down| (0..POWERS).flat_map(move |across| [(down, across, 0), (down, across, 1)]))
}

/// The polynomials across, of both coordinates.
#[inline(always)]
fn across<const FUSED: bool, const W: usize>(sums: &[[f64; W]; ROW], x: &[f64; W]) -> [[f64; W]; 2] {
    let [[a, b], [c, d], [e, f], [g, h]] = coordinates(sums);
    let (mut first, mut second) = ([0.0; W], [0.0; W]);
    for j in 0..W {
        let x = x[j];
        let fused = multiply_add::<FUSED>;
        first[j] = fused(fused(fused(g[j], x, e[j]), x, c[j]), x, a[j]);
        second[j] = fused(fused(fused(h[j], x, f[j]), x, d[j]), x, b[j]);
    }
    [first, second]
}

/// Their derivatives.
#[inline(always)]
fn slopes_across<const FUSED: bool, const W: usize>(sums: &[[f64; W]; ROW], x: &[f64; W]) -> [[f64; W]; 2] {
    let [_, [c, d], [e, f], [g, h]] = coordinates(sums);
    let (mut first, mut second) = ([0.0; W], [0.0; W]);
    for j in 0..W {
        let (x, fused) = (x[j], multiply_add::<FUSED>);
        first[j] = fused(fused(3.0 * g[j], x, 2.0 * e[j]), x, c[j]);
        second[j] = fused(fused(3.0 * h[j], x, 2.0 * f[j]), x, d[j]);
    }
    [first, second]
}

/// The coefficients of both coordinates for each power.
#[inline(always)]
fn coordinates<const W: usize>([a, b, c, d, e, f, g, h]: &[[f64; W]; ROW]) -> [[&[f64; W]; 2]; POWERS] {
    [[a, b], [c, d], [e, f], [g, h]]
}
