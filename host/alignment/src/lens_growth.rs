//! Whether both lenses are longer or shorter than at their calibration, as another focus or temperature makes them, by the matches of one pair.
//!
//! Where each lens images a fraction s farther from its centre, the ray of a pixel at c + m is that of the lens as calibrated at c + m (1 - s).
//! That turns the rays out of their common epipolar plane in a pattern over the field that differs from that of a turned or shifted camera.
//! So s is estimated beside the pose, of which next to nothing counts as known: a camera that was knocked makes no lens longer. The errors of
//! both lenses that their calibration states are unknowns too, with its covariance.
//!
//! Windows that share pixels share their errors, so that one match of each square of two degrees counts ([`crate::residual_spread`]), and where
//! the residuals are larger than stated, the standard deviation is by as much.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector6};

use crate::pose_equation::{Equation, LENSES, SCALE_SIGMAS, moved, robust_weight};
use crate::residual_spread::Place;
use vergence_vision::{KannalaBrandt, LENS_PARAMETERS, MatchSigma, Pixel, PixelPair, SharedCovariance, StereoPair};

/// The unknowns that robust weights depend on: the correction of the pose, and the growth.
const UNKNOWNS: usize = 7;
const GROWTH: usize = 6;
type Prior = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
/// Smallest number of matches, one of each square.
const LEAST_MATCHES: usize = 30;
/// Number of times the equations are linearised, and iterations of each.
const ROUNDS: usize = 2;
const ITERATIONS: usize = 10;
/// Scale of the first iterations, in standard deviations.
const FIRST_SIGMAS: f64 = 20.0;
/// Standard deviations of the prior of the pose's turn and of the direction of its baseline, in radians, and of the growth.
const GROSS: f64 = 0.05;
const GROSS_GROWTH: f64 = 0.05;
/// Residuals beyond so many standard deviations are those of wrong matches.
const AGREES: f64 = 4.0;
/// By chance one pair in two million is so many standard deviations off.
const SIGNIFICANT: f64 = 5.0;

/// How much longer both lenses look than at their calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensGrowth {
    /// As a fraction of the focal length.
    pub growth: f64,
    /// Its standard deviation by the matches and by the stated covariance of both lenses.
    pub sigma: f64,
}

impl LensGrowth {
    /// Whether it is more than the noise of matches and the stated covariance of the lenses explain.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.growth.abs() > SIGNIFICANT * self.sigma
    }
}

/// Compares the lenses of `pair` with matches, each given with its standard deviations in pixels; some may be wrong. `shared` is the stated
/// covariance of both lenses; its pose does not count.
///
/// Starts at the pose of `pair` corrected by `drift` ([`crate::PoseDrift::correction`]). `None` where there are too few matches.
#[must_use]
pub fn lens_growth<S: Copy + Into<MatchSigma>>(
    pixels: &[(PixelPair, S)],
    pair: &StereoPair<'_>,
    drift: &Vector6<f64>,
    shared: &SharedCovariance,
) -> Option<LensGrowth> {
    let mut found = StereoPair { left_from_right: moved(&pair.left_from_right, drift), ..*pair };
    let prior = prior(pair.left_from_right.origin().mm().norm());
    let chosen = one_of_each_square(pixels, pair.left.size().width);
    let (mut rows, mut unknowns) = (Vec::new(), SVector::<f64, UNKNOWNS>::zeros());
    for _ in 0..ROUNDS {
        rows = chosen.iter().filter_map(|(pixels, sigma)| Row::of(pixels, *sigma, &found)).collect();
        if rows.len() < LEAST_MATCHES {
            return None;
        }
        for iteration in 0..ITERATIONS {
            let fade = 1.0 - (iteration + 1) as f64 / ITERATIONS as f64;
            let scale = SCALE_SIGMAS + (FIRST_SIGMAS - SCALE_SIGMAS) * fade * fade;
            let (mut normal, mut right_side) = (prior, SVector::zeros());
            for row in &rows {
                let weight = robust_weight(row.residual(&unknowns) / scale);
                normal += row.slope * row.slope.transpose() * weight;
                right_side -= row.slope * (weight * row.offset);
            }
            unknowns = normal.cholesky()?.solve(&right_side);
        }
        found.left_from_right = moved(&found.left_from_right, &unknowns.fixed_rows::<GROWTH>(0).into_owned());
    }
    rows.retain(|row| row.residual(&unknowns).abs() <= AGREES);
    least_squares(&rows, &prior, shared)
}

/// Next to nothing is known; a shift along the baseline has no effect and needs some prior.
fn prior(baseline_mm: f64) -> Prior {
    let (turn, shift, growth) = (GROSS.powi(-2), (GROSS * baseline_mm).powi(-2), GROSS_GROWTH.powi(-2));
    Prior::from_diagonal(&[turn, turn, turn, shift, shift, shift, growth].into())
}

/// The first match of each square of the left image.
fn one_of_each_square<S: Copy + Into<MatchSigma>>(
    pixels: &[(PixelPair, S)],
    width: u32,
) -> Vec<(PixelPair, MatchSigma)> {
    let mut squares = BTreeMap::new();
    for (pixels, sigma) in pixels {
        squares.entry(Place::of(pixels.left, width).square()).or_insert((*pixels, (*sigma).into()));
    }
    squares.into_values().collect()
}

/// A match's equation offset + slope · unknowns + `by_lenses` · errors of the lenses = 0, in its standard deviations.
struct Row {
    offset: f64,
    slope: SVector<f64, UNKNOWNS>,
    by_lenses: SVector<f64, LENSES>,
}

impl Row {
    fn of(pixels: &PixelPair, sigma: MatchSigma, pair: &StereoPair<'_>) -> Option<Self> {
        /// Where cx and cy stand among the parameters of a lens.
        const CENTRE: usize = 2;
        let (equation, by_lenses) = Equation::with_lenses(pixels, sigma, pair)?;
        let by_growth = |lens: &KannalaBrandt, at: Pixel, first: usize| {
            let (u, v) = (at.u - lens.centre().u, at.v - lens.centre().v);
            u * by_lenses[first + CENTRE] + v * by_lenses[first + CENTRE + 1]
        };
        let (over, mut slope) = (equation.sigma.recip(), SVector::<f64, UNKNOWNS>::zeros());
        slope.fixed_rows_mut::<GROWTH>(0).copy_from(&(equation.slope * over));
        slope[GROWTH] =
            over * (by_growth(pair.left, pixels.left, 0) + by_growth(pair.right, pixels.right, LENS_PARAMETERS));
        Some(Self { offset: equation.offset * over, slope, by_lenses: by_lenses * over })
    }

    fn residual(&self, unknowns: &SVector<f64, UNKNOWNS>) -> f64 {
        self.offset + self.slope.dot(unknowns)
    }
}

/// The growth by `rows`, with the errors of both lenses as unknowns.
fn least_squares(rows: &[Row], prior: &Prior, shared: &SharedCovariance) -> Option<LensGrowth> {
    if rows.len() < LEAST_MATCHES {
        return None;
    }
    let spread = spread_of_lenses(shared);
    let unknowns = UNKNOWNS + spread.ncols();
    let design = DMatrix::from_fn(rows.len(), unknowns, |row, column| match column.checked_sub(UNKNOWNS) {
        None => rows[row].slope[column],
        Some(error) => rows[row].by_lenses.dot(&spread.column(error)),
    });
    let offsets = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.offset));
    let mut normal = design.tr_mul(&design);
    for i in 0..unknowns {
        normal[(i, i)] += if i < UNKNOWNS { prior[(i, i)] } else { 1.0 };
    }
    let inverse = normal.cholesky()?.inverse();
    let found = -(&inverse * design.tr_mul(&offsets));
    let squares = (&offsets + &design * &found).norm_squared();
    let freedom = rows.len().saturating_sub(UNKNOWNS).max(1) as f64;
    let sigma = (inverse[(GROWTH, GROWTH)] * (squares / freedom).max(1.0)).sqrt();
    Some(LensGrowth { growth: found[GROWTH], sigma })
}

/// A matrix S with S Sᵀ the stated covariance of both lenses, a column for each parameter that is not exact.
fn spread_of_lenses(shared: &SharedCovariance) -> DMatrix<f64> {
    let covariance = shared.matrix().fixed_view::<LENSES, LENSES>(0, 0);
    let unknown: Vec<usize> = (0..LENSES).filter(|&i| covariance[(i, i)] > 0.0).collect();
    if unknown.is_empty() {
        return DMatrix::zeros(LENSES, 0);
    }
    let sigma: Vec<f64> = unknown.iter().map(|&i| covariance[(i, i)].sqrt()).collect();
    // Pixels and ratios differ by orders of magnitude: the eigenvalues are those of the correlation.
    let correlation = DMatrix::from_fn(unknown.len(), unknown.len(), |i, j| {
        covariance[(unknown[i], unknown[j])] / (sigma[i] * sigma[j])
    });
    let eigen = correlation.symmetric_eigen();
    let mut spread = DMatrix::zeros(LENSES, unknown.len());
    for (row, &parameter) in unknown.iter().enumerate() {
        for column in 0..unknown.len() {
            let root = eigen.eigenvalues[column].max(0.0).sqrt();
            spread[(parameter, column)] = sigma[row] * eigen.eigenvectors[(row, column)] * root;
        }
    }
    spread
}
