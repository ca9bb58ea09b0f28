//! How far matches really are off the epipolar planes of a pose, beside what their standard deviations state.
//!
//! Errors of a matcher are not those of independent draws. Windows that share pixels share their errors: those of matches closer than two
//! degrees have correlations of 0.9 to 0.1, and beyond there is none to be seen (docs/measured/robot.md). So the variance of what the matches say
//! together is taken from products of the residuals of all pairs of matches that are so close (T. Conley, Journal of Econometrics 92(1), 1999).
//! The pose found bends to them, which makes the products too small; the sum is enlarged so that it is right where the errors are
//! independent (after R. Bell and D. McCaffrey, Survey Methodology 28(2), 2002). One factor for all components of the pose is estimated:
//! some hundred windows do not tell a matrix.
//!
//! What all matches of a large region have in common no residual shows, because the pose follows it. So matches of one cell share an error of [`SHARED_PX`].

use std::collections::BTreeMap;

use nalgebra::{Matrix6, Vector6};

use crate::pose_equation::Equation;
use vergence_vision::Pixel;

/// Distances within which errors are correlated, across an image: 2 degrees of a lens with 196.
const WINDOWS_ACROSS: f64 = 98.0;
/// Number of cells across an image: 49 degrees of a lens with 196.
const CELLS_ACROSS: f64 = 4.0;
/// Standard deviation of an error that the matches of a cell have in common, in pixels. It was chosen on 24 trials of each mode of the robot
/// and holds in others (docs/measured/robot.md).
const SHARED_PX: f64 = 0.004;
/// With fewer cells than this the variance may only grow, because their matches hardly tell it.
const ENOUGH_CELLS: usize = 6;
/// Smallest part of the residuals that the pose leaves.
const LEAST_LEFT: f64 = 0.1;

/// The cell of a pixel in an image `width` pixels wide, with so many cells `across`.
fn cell_of(pixel: Pixel, width: u32, across: f64) -> [i32; 2] {
    [pixel.u, pixel.v].map(|place| (place * across / f64::from(width)).floor() as i32)
}

/// The place of a match in the left image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// In units of the distance within which errors are correlated.
    at: [f64; 2],
    /// The square of that unit, and the cell, in which it lies.
    square: [i32; 2],
    cell: [i32; 2],
}

impl Place {
    pub(crate) fn of(pixel: Pixel, width: u32) -> Self {
        let at = [pixel.u, pixel.v].map(|place| place * WINDOWS_ACROSS / f64::from(width));
        Self { at, square: cell_of(pixel, width, WINDOWS_ACROSS), cell: cell_of(pixel, width, CELLS_ACROSS) }
    }

    /// The square, as wide as errors are correlated, in which it lies.
    pub(crate) const fn square(&self) -> [i32; 2] {
        self.square
    }

    fn is_near(&self, other: &Self) -> bool {
        (self.at[0] - other.at[0]).hypot(self.at[1] - other.at[1]) < 1.0
    }
}

/// The variance of what `equations` tell of the pose at the correction `step`, over that which their standard deviations state, had they
/// independent errors. `left` is what the equations leave of a unit covariance of the pose in the coordinates of `spread`, and
/// `told` how many components they tell.
pub(crate) fn variance_factor(
    equations: &[Equation],
    step: &Vector6<f64>,
    spread: &Matrix6<f64>,
    left: &Matrix6<f64>,
    told: f64,
) -> f64 {
    let mut squares: BTreeMap<[i32; 2], Vec<Window>> = BTreeMap::new();
    let mut cells: Vec<[i32; 2]> = Vec::new();
    let (mut sum, mut count) = (0.0, 0.0);
    for equation in equations.iter().filter(|equation| equation.agrees(step)) {
        let (slope, relative) =
            (spread.transpose() * equation.slope / equation.sigma, equation.residual(step) / equation.sigma);
        let window = Window { place: equation.place, slope, told: left * slope, relative };
        squares.entry(equation.place.square).or_default().push(window);
        cells.push(equation.place.cell);
        sum += relative * relative;
        count += 1.0;
    }
    // The pose found bends to the residuals, which are too small by that.
    let each = sum / (count - told).max(1.0);
    let (mut found, mut stated, mut bent) = (0.0, 0.0, 0.0);
    for ([u, v], windows) in &squares {
        let around = (u - 1..=u + 1).flat_map(|u| (v - 1..=v + 1).map(move |v| [u, v]));
        let near: Vec<&Window> = around.filter_map(|square| squares.get(&square)).flatten().collect();
        for window in windows {
            stated += window.told.dot(&window.slope);
            for other in near.iter().filter(|other| window.place.is_near(&other.place)) {
                // How much one residual moves what the pose says of the other.
                let moved = window.told.dot(&other.slope);
                found += moved * window.relative * other.relative;
                bent += moved * moved;
            }
        }
    }
    let factor = (found / (stated - bent).max(LEAST_LEFT * stated).max(f64::MIN_POSITIVE)).max(each);
    cells.sort_unstable();
    cells.dedup();
    if cells.len() < ENOUGH_CELLS { factor.max(1.0) } else { factor }
}

/// The covariance of the pose from the errors that the matches of a cell have in common, in the coordinates of `spread`. The pose was
/// found with the variances of `equations` times `factor`; `radian` is the number of pixels of one.
pub(crate) fn shared_covariance(
    equations: &[Equation],
    step: &Vector6<f64>,
    spread: &Matrix6<f64>,
    left: &Matrix6<f64>,
    (factor, radian): (f64, f64),
) -> Matrix6<f64> {
    let mut cells: BTreeMap<[i32; 2], Vector6<f64>> = BTreeMap::new();
    for equation in equations.iter().filter(|equation| equation.agrees(step)) {
        let weighed = spread.transpose() * equation.slope / (equation.sigma * equation.sigma * factor);
        *cells.entry(equation.place.cell).or_default() += weighed * (SHARED_PX / radian);
    }
    cells.values().map(|sum| left * sum).map(|moved| moved * moved.transpose()).sum()
}

/// A match as the variance counts it.
struct Window {
    place: Place,
    /// What it tells of the pose, in its own standard deviations, and how far the pose moves by one of them.
    slope: Vector6<f64>,
    told: Vector6<f64>,
    /// Its residual, in standard deviations.
    relative: f64,
}
