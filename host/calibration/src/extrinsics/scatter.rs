//! How far the views disagree on the relative pose, and what that does to its covariance.
//!
//! The corners of one view alone determine a relative pose: the left ones place the target, the right ones the right
//! camera before it. Where the lenses are right, the target is flat and both images were taken at one instant, these
//! poses scatter about the joint one as the noise of the corners makes them. Where they scatter more, the errors of a
//! view's corners are not independent, and a covariance that takes them for independent is too small.

use nalgebra::{Cholesky, DMatrix, Isometry3, SMatrix, SVector};

use crate::extrinsics::stereo::{LensPrior, Pair};
use crate::extrinsics::{Fit, StereoView};
use crate::reprojection::{LENS, POSE};

/// Unknowns of a view that has a relative pose of its own: that pose, then the target's.
const OWN: usize = 2 * POSE;

/// Scatter of the views' own relative poses about the joint one in units of what noise of standard deviation `sigma`
/// (in relative sigmas of the corners) explains; a ratio of standard deviations, at least 1.
///
/// The square is a reduced chi-squared: what the sum of squares loses when each view gets a relative pose of its own
/// (one Gauss-Newton step), per degree of freedom that this adds, over `sigma`². Standard deviations are multiplied by
/// its root as in R. Birge, "The calculation of errors by the method of least squares", Phys. Rev. 40, 1932. Lenses are
/// held as they were fitted.
pub(crate) fn view_scatter(
    pair: &Pair,
    views: &[StereoView],
    targets: &[Isometry3<f64>],
    inliers: &[Vec<bool>],
    sigma: f64,
) -> f64 {
    let gains = views.iter().zip(targets).zip(inliers);
    let gains: Vec<f64> = gains.filter_map(|((view, target), used)| gain(pair, view, target, used)).collect();
    let freedom = POSE * gains.len().saturating_sub(1);
    if freedom == 0 {
        return 1.0;
    }
    let reduced = gains.iter().sum::<f64>() / (freedom as f64 * sigma * sigma);
    if reduced.is_finite() { reduced.max(1.0).sqrt() } else { 1.0 }
}

/// What the sum of squares of `view` loses by a relative pose of its own; `None` where its corners leave that open.
fn gain(pair: &Pair, view: &StereoView, left_from_target: &Isometry3<f64>, used: &[bool]) -> Option<f64> {
    let mut normal = SMatrix::<f64, OWN, OWN>::zeros();
    let mut gradient = SVector::<f64, OWN>::zeros();
    for ((side, corner), _) in view.corners().zip(used).filter(|(_, used)| **used) {
        let residual = pair.residual(side, corner, left_from_target)?;
        let mut by = SMatrix::<f64, 2, OWN>::zeros();
        by.fixed_columns_mut::<POSE>(0).copy_from(&residual.by_relative_pose);
        by.fixed_columns_mut::<POSE>(POSE).copy_from(&residual.by_target);
        by /= corner.relative_sigma;
        normal += by.transpose() * by;
        gradient += by.transpose() * residual.error / corner.relative_sigma;
    }
    // Scaled to unit diagonal: radians and millimetres differ by orders of magnitude.
    let scale = normal.diagonal().map(|square| 1.0 / square.sqrt());
    let unit = Cholesky::new(SMatrix::from_fn(|i, j| normal[(i, j)] * scale[i] * scale[j]))?;
    let gradient = gradient.component_mul(&scale);
    Some(gradient.dot(&unit.solve(&gradient)))
}

/// The covariance of the relative pose, and of the lenses where they were refined, where the corners' noise counts `scatter` times as large; what is known of the
/// lenses besides, `lens_prior` in units of the fit's sigma, counts as before. `None` where it is not determined.
pub(crate) fn scattered_covariance<S>(fit: &Fit<S>, lens_prior: &LensPrior, scatter: f64) -> Option<DMatrix<f64>> {
    let (excess, mut information) = (scatter * scatter - 1.0, fit.information.clone());
    for (index, prior) in lens_prior.information().into_iter().flatten().enumerate() {
        let first = POSE + index * LENS;
        information.view_mut((first, first), (LENS, LENS)).zip_apply(&prior, |sum, x| *sum += excess * x);
    }
    let scale = information.diagonal().map(|square| 1.0 / square.sqrt());
    let n = information.nrows();
    let unit = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(unit)?.inverse();
    let variance = (scatter * fit.sigma).powi(2);
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j] * variance))
}
