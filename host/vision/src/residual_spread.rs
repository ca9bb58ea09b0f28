//! How far matches really are off the epipolar planes of a pose, beside what their standard deviations state.
//!
//! Errors of a matcher are not those of independent draws: neighbouring windows share pixels, and a surface that is seen aslant pulls
//! all of its matches alike. So the variance of what the matches say together is taken from sums over cells of the image, within which
//! errors may be correlated in any way (K.-Y. Liang and S. Zeger, Biometrika 73(1), 1986). The pose found bends to each cell, which
//! makes its sum too small; it is enlarged so that the variance is right where the errors are independent (the bias-reduced linearisation
//! of R. Bell and D. McCaffrey, Survey Methodology 28(2), 2002). Their other correction, to what a cell would say of a pose found without
//! it, triples the variance where few cells tell a component (docs/measured/robot.md).
//! One factor for all components of the pose is estimated: the few dozen cells of an image do not tell a matrix.

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SymmetricEigen, Vector6};

use crate::Pixel;
use crate::pose_equation::Equation;

/// Number of cells across an image: 24 degrees of a lens with 196. Smaller ones leave out how neighbouring cells are correlated: with 16
/// degrees the pose in spider was stated too well in rendered images (docs/measured/robot.md).
const CELLS_ACROSS: f64 = 8.0;
/// Smallest part of a component that other cells tell: one that a cell tells alone says nothing of its errors.
const LEAST_LEFT: f64 = 0.01;
/// With fewer cells than this the variance may only grow, because their sums hardly tell it.
const ENOUGH_CELLS: usize = 8;

/// The cell of a pixel in an image `width` pixels wide.
pub(crate) fn cell_of(pixel: Pixel, width: u32) -> [i32; 2] {
    [pixel.u, pixel.v].map(|place| (place * CELLS_ACROSS / f64::from(width)).floor() as i32)
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
    let mut cells: BTreeMap<[i32; 2], Cell> = BTreeMap::new();
    let (mut squares, mut count) = (0.0, 0.0);
    for equation in equations.iter().filter(|equation| equation.agrees(step)) {
        let (slope, relative) =
            (spread.transpose() * equation.slope / equation.sigma, equation.residual(step) / equation.sigma);
        let cell = cells.entry(equation.cell).or_default();
        cell.sum += slope * relative;
        cell.information += slope * slope.transpose();
        squares += relative * relative;
        count += 1.0;
    }
    // The pose found bends to the residuals, which are too small by that.
    let each = squares / (count - told).max(1.0);
    let root = of_eigenvalues(left, |value| value.max(0.0).sqrt());
    let (mut found, mut stated) = (0.0, 0.0);
    for cell in cells.values() {
        // The part of each component of the pose that the cell tells: its sum has the variance share (1 - share).
        let share = root * cell.information * root;
        let enlarged = of_eigenvalues(&share, |value| (1.0 - value).max(LEAST_LEFT).sqrt().recip());
        found += (enlarged * root * cell.sum).norm_squared();
        stated += share.trace();
    }
    let factor = (found / stated.max(f64::MIN_POSITIVE)).max(each);
    if cells.len() < ENOUGH_CELLS { factor.max(1.0) } else { factor }
}

/// A symmetric matrix with `of` applied to its eigenvalues.
fn of_eigenvalues(matrix: &Matrix6<f64>, of: impl Fn(f64) -> f64) -> Matrix6<f64> {
    let eigen = SymmetricEigen::new((matrix + matrix.transpose()) / 2.0);
    eigen.eigenvectors * Matrix6::from_diagonal(&eigen.eigenvalues.map(of)) * eigen.eigenvectors.transpose()
}

/// The matches of one cell: the sum of what they say of the pose, and how much they tell of it if each stands for itself.
#[derive(Default)]
struct Cell {
    sum: Vector6<f64>,
    information: Matrix6<f64>,
}
