//! B-spline surfaces with two values, many places at once.
//!
//! Each interval of the grid is a polynomial: the four powers along the one axis of the four along the other, both values in one vector. Places are
//! numbers of control points, from 0, along both axes.

use super::lanes::multiply_add;

/// Powers along an axis.
const POWERS: usize = 4;
/// Both values of half of the powers across.
const HALF: usize = POWERS;
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

/// Coefficients of an interval, in whole lines of the cache.
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
struct Cell<T>([[[T; HALF]; 2]; POWERS]);

/// The powers across at each place, of both values: the lower, and the higher.
#[repr(align(64))]
struct Powers<T, const W: usize>([[[T; HALF]; W]; 2]);

/// What the numbers of a surface are.
pub(super) trait Number: Copy + Default {
    fn of(number: f64) -> Self;
    fn long(self) -> f64;
    /// Returns a b + c.
    fn fused<const FUSED: bool>(a: Self, b: Self, c: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn of(number: f64) -> Self {
        number
    }

    #[inline(always)]
    fn long(self) -> f64 {
        self
    }

    #[inline(always)]
    fn fused<const FUSED: bool>(a: Self, b: Self, c: Self) -> Self {
        multiply_add::<FUSED>(a, b, c)
    }
}

/// Half the memory and time, for a surface that need not be exact.
impl Number for f32 {
    #[inline(always)]
    fn of(number: f64) -> Self {
        number as Self
    }

    #[inline(always)]
    fn long(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn fused<const FUSED: bool>(a: Self, b: Self, c: Self) -> Self {
        if FUSED { a.mul_add(b, c) } else { a * b + c }
    }
}

/// A surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface<T = f64> {
    /// Of each axis: the number of the last interval, and the edges.
    last: [f64; 2],
    edges: [[f64; 2]; 2],
    /// Added before a number is cut off.
    rounding: f64,
    cells: Vec<Cell<T>>,
}

/// Where places lie on a surface.
#[repr(align(64))]
pub(super) struct OnSurface<const W: usize> {
    cell: [usize; W],
    /// Within the interval.
    at: [[f64; W]; 2],
}

/// Values, and their derivatives across and down.
#[repr(align(64))]
pub(super) struct Steep<const W: usize> {
    pub values: [[f64; W]; 2],
    pub across: [[f64; W]; 2],
    pub down: [[f64; W]; 2],
}

impl<T: Number> Surface<T> {
    /// The surface of this order with so many control points across and down, which `control` has row by row.
    pub(super) fn new(order: usize, [columns, rows]: [usize; 2], control: &[[f64; 2]]) -> Self {
        let (basis, short) = if order == 3 { (&CUBIC, 3.0) } else { (&QUADRATIC, 2.0) };
        let counts = [columns as f64, rows as f64];
        let cell = |top: usize, left: usize| {
            let mut cell = [[[0.0; HALF]; 2]; POWERS];
            for (row, column) in (0..=order).flat_map(|row| (0..=order).map(move |column| (row, column))) {
                let Some(point) = control.get((top + row) * columns + left + column) else { continue };
                for (down, across, axis) in powers() {
                    cell[down][across / 2][2 * (across % 2) + axis] +=
                        basis[row][down] * basis[column][across] * point[axis];
                }
            }
            Cell(cell.map(|row| row.map(|half| half.map(T::of))))
        };
        let cells = (0..rows.saturating_sub(order))
            .flat_map(|top| (0..columns.saturating_sub(order)).map(move |left| (top, left)))
            .map(|(top, left)| cell(top, left))
            .collect();
        let low = 0.5 * (short - 1.0);
        Self {
            last: counts.map(|count| count - short),
            edges: counts.map(|count| [low, count - 1.0 - low]),
            rounding: if order == 3 { 0.0 } else { 0.5 },
            cells,
        }
    }

    /// Intervals of the grid to the nearest edge; negative outside.
    #[inline(always)]
    pub(super) fn inside<const W: usize>(&self, places: &[[f64; W]; 2]) -> [f64; W] {
        let mut inside = [f64::INFINITY; W];
        for (places, [low, high]) in places.iter().zip(self.edges) {
            for j in 0..W {
                let place = places[j];
                let nearer = if place - low < high - place { place - low } else { high - place };
                // What is no number is outside.
                let nearer = if place.is_nan() { -1.0 } else { nearer };
                inside[j] = if nearer < inside[j] { nearer } else { inside[j] };
            }
        }
        inside
    }

    /// The intervals of places; those outside are on the interval at the edge, which goes on.
    #[inline(always)]
    pub(super) fn located<const FUSED: bool, const W: usize>(&self, places: &[[f64; W]; 2]) -> OnSurface<W> {
        let mut found = OnSurface { cell: [0; W], at: *places };
        let mut number = [[0.0; W]; 2];
        for axis in 0..2 {
            let last = self.last[axis];
            for j in 0..W {
                let start = (places[axis][j] + self.rounding).floor();
                let start = if start < last { start } else { last };
                let start = if start > 1.0 { start } else { 1.0 };
                found.at[axis][j] = places[axis][j] - start;
                number[axis][j] = start - 1.0;
            }
        }
        for j in 0..W {
            let number = multiply_add::<FUSED>(number[1][j], self.last[0], number[0][j]);
            found.cell[j] = ((number + INTEGER).to_bits() & 0xFFFF_FFFF) as usize;
        }
        found
    }

    /// The place itself, or the nearest one that is at most `beyond` intervals outside.
    pub(super) fn kept(&self, place: [f64; 2], beyond: f64) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [low, high] = self.edges[axis];
            place[axis].clamp(low - beyond, high + beyond)
        })
    }

    /// Values.
    #[inline(always)]
    pub(super) fn values<const FUSED: bool, const W: usize>(&self, on: &OnSurface<W>) -> [[f64; W]; 2] {
        let mut sums = Powers::<T, W>::zero();
        // One place at a time: vectors over places would gather the numbers of their cells one by one.
        for j in 0..W {
            // Never absent: places are kept on the grid.
            let Some(Cell([a, b, c, d])) = self.cells.get(on.cell[j]) else { break };
            let y = T::of(on.at[1][j]);
            for half in 0..2 {
                let mut sum = d[half];
                for row in [c, b, a] {
                    for i in 0..HALF {
                        sum[i] = T::fused::<FUSED>(sum[i], y, row[half][i]);
                    }
                }
                sums.0[half][j] = sum;
            }
        }
        across::<T, FUSED, W>(&sums, &on.at[0])
    }
}

impl Surface {
    /// Values with their derivatives.
    #[inline(always)]
    pub(super) fn steep<const FUSED: bool, const W: usize>(&self, on: &OnSurface<W>) -> Steep<W> {
        let (mut sums, mut slopes) = (Powers::<f64, W>::zero(), Powers::<f64, W>::zero());
        for j in 0..W {
            let Some(Cell([a, b, c, d])) = self.cells.get(on.cell[j]) else { break };
            let y = on.at[1][j];
            for half in 0..2 {
                let (mut sum, mut slope) = (d[half], [0.0; HALF]);
                for row in [c, b, a] {
                    for i in 0..HALF {
                        slope[i] = multiply_add::<FUSED>(slope[i], y, sum[i]);
                        sum[i] = multiply_add::<FUSED>(sum[i], y, row[half][i]);
                    }
                }
                (sums.0[half][j], slopes.0[half][j]) = (sum, slope);
            }
        }
        let x = &on.at[0];
        let (values, down) = (across::<f64, FUSED, W>(&sums, x), across::<f64, FUSED, W>(&slopes, x));
        Steep { values, across: slopes_across::<FUSED, W>(&sums, x), down }
    }
}

impl<T: Number, const W: usize> Powers<T, W> {
    #[inline(always)]
    fn zero() -> Self {
        Self([[[T::default(); HALF]; W]; 2])
    }
}

/// All powers along both axes, for both values.
fn powers() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..POWERS).flat_map(|down| (0..POWERS).flat_map(move |across| [(down, across, 0), (down, across, 1)]))
}

/// The polynomials across a + b x + c x² + d x³.
#[inline(always)]
fn across<T: Number, const FUSED: bool, const W: usize>(
    Powers([low, high]): &Powers<T, W>,
    x: &[f64; W],
) -> [[f64; W]; 2] {
    let (fused, mut values) = (T::fused::<FUSED>, [[0.0; W]; 2]);
    for j in 0..W {
        let ([a, e, b, f], [c, g, d, h], x) = (low[j], high[j], T::of(x[j]));
        values[0][j] = fused(fused(fused(d, x, c), x, b), x, a).long();
        values[1][j] = fused(fused(fused(h, x, g), x, f), x, e).long();
    }
    values
}

/// Their derivatives.
#[inline(always)]
fn slopes_across<const FUSED: bool, const W: usize>(
    Powers([low, high]): &Powers<f64, W>,
    x: &[f64; W],
) -> [[f64; W]; 2] {
    let (fused, mut slopes) = (multiply_add::<FUSED>, [[0.0; W]; 2]);
    for j in 0..W {
        let ([_, _, b, f], [c, g, d, h], x) = (low[j], high[j], x[j]);
        slopes[0][j] = fused(fused(3.0 * d, x, 2.0 * c), x, b);
        slopes[1][j] = fused(fused(3.0 * h, x, 2.0 * g), x, f);
    }
    slopes
}
