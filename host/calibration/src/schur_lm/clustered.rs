//! The covariance of the shared unknowns where the errors of one small block's residuals are not independent of each other.
//!
//! The inverse of the information says how far noise that is independent from corner to corner moves the unknowns. The residuals of
//! real views err together: the lens is not quite of the model's family, the target bends, or both images were not taken at one
//! instant. Views are independent of each other, and each shows in its gradient how far it pulls at the unknowns. With H the
//! information of the shared unknowns, P the part of it that priors give, and H_v and s_v the information and the gradient of view v,
//! its own unknowns eliminated:
//!
//! ```text
//! covariance = H⁻¹ (S + σ² P) H⁻¹        S = Σ_v y_v y_vᵀ        y_v = (I - H_v H⁻¹)^(-1/2) s_v
//! ```
//!
//! The root makes up for what a view pulls the estimate towards itself: of white noise, S is σ² Σ H_v on average (R. Bell and D.
//! McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples", Survey Methodology 28, 2002).
//!
//! A dozen views tell how strongly views pull on average, but hardly a matrix of eight rows and columns. Therefore S is drawn towards
//! φ σ² Σ H_v, white noise that is √φ times as large, by the share that its own scatter from view to view asks for (O. Ledoit and
//! M. Wolf, "A well-conditioned estimator for large-dimensional covariance matrices", J. Multivariate Analysis 88, 2004). What is left
//! of that scatter makes errors large in units of their covariance, as Student's t is wider than a Gaussian; the covariance is
//! grown to make up for it, to second order.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::SchurNormal;
use super::normal::determined;

/// How much of the estimate a single view may determine in some direction before its pull there no longer counts as known.
const MOST_LEVERAGE: f64 = 0.99;

/// The covariance of the shared unknowns by [`SchurNormal::clustered`].
pub struct Clustered {
    /// The covariance.
    pub covariance: DMatrix<f64>,
    /// √φ: how strongly the blocks pull at the shared unknowns, in units of what noise explains; at least 1.
    pub scatter: f64,
}

/// What one block says of the shared unknowns, in coordinates in which the information of all together is the identity.
struct Pull {
    information: DMatrix<f64>,
    /// y_v.
    gradient: DVector<f64>,
}

impl<const B: usize> SchurNormal<B> {
    /// The marginal covariance of the shared step where the residuals of a block may err together, for `variance`, that of one
    /// residual component, by which priors are weighted. `None` where the unknowns are not determined.
    #[must_use]
    pub fn clustered(&self, variance: f64) -> Option<Clustered> {
        self.clustered_with_priors(variance, variance)
    }

    /// The same where priors were weighted by another variance than that of the residuals.
    #[must_use]
    pub fn clustered_with_priors(&self, variance: f64, of_priors: f64) -> Option<Clustered> {
        let whiten = self.whiten()?;
        let n = whiten.nrows();
        let pulls: Vec<Pull> =
            (0..self.block_count()).into_par_iter().map(|block| self.pull(block, &whiten)).collect::<Option<_>>()?;
        let by_views = pulls.iter().fold(DMatrix::zeros(n, n), |sum, pull| sum + &pull.information);
        let (meat, factor) = meat(&pulls, &by_views, variance);
        let prior = (DMatrix::identity(n, n) - by_views) * of_priors;
        let covariance = whiten.transpose() * (meat + prior) * &whiten;
        Some(Clustered { covariance: (&covariance + covariance.transpose()) * 0.5, scatter: factor.sqrt() })
    }

    /// [`Clustered::scatter`] alone, which costs less.
    #[must_use]
    pub(crate) fn scatter(&self, variance: f64) -> Option<f64> {
        let whiten = self.whiten()?;
        let (mut spread, mut by_views) = (0.0, 0.0);
        for block in 0..self.block_count() {
            let (information, gradient) = self.eliminated(block)?;
            let (information, gradient) = (&whiten * information * whiten.transpose(), &whiten * gradient);
            by_views += information.trace();
            spread += grown_square(information, &gradient);
        }
        let level = spread / by_views;
        Some(if level > 0.0 && level.is_finite() { (level / variance).max(1.0).sqrt() } else { 1.0 })
    }

    /// The coordinates in which the information of all blocks together is the identity.
    fn whiten(&self) -> Option<DMatrix<f64>> {
        let information = self.shared_information()?;
        let scale = DMatrix::from_diagonal(&information.diagonal().map(|d| 1.0 / d.sqrt()));
        determined(&scale * &information * &scale)?.l().solve_lower_triangular(&scale)
    }

    fn pull(&self, block: usize, whiten: &DMatrix<f64>) -> Option<Pull> {
        let (information, gradient) = self.eliminated(block)?;
        let information = whiten * information * whiten.transpose();
        let (along, vectors) = grown(information.clone(), &(whiten * gradient));
        Some(Pull { information, gradient: vectors * along })
    }
}

/// y_v along the eigenvectors of H_v, and these, from H_v and s_v.
fn grown(information: DMatrix<f64>, gradient: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let eigen = SymmetricEigen::new(information);
    let grown = eigen.eigenvalues.map(|share| 1.0 / (1.0 - share.clamp(0.0, MOST_LEVERAGE)).sqrt());
    (eigen.eigenvectors.tr_mul(gradient).component_mul(&grown), eigen.eigenvectors)
}

/// The square of the length of y_v: without eigenvectors where no direction has more than the most leverage.
fn grown_square(information: DMatrix<f64>, gradient: &DVector<f64>) -> f64 {
    let beside =
        |most: f64| Cholesky::new(DMatrix::from_diagonal_element(gradient.len(), gradient.len(), most) - &information);
    match (beside(MOST_LEVERAGE), beside(1.0)) {
        (Some(_), Some(rest)) => gradient.dot(&rest.solve(gradient)),
        _ => grown(information, gradient).0.norm_squared(),
    }
}

/// S drawn towards `by_views`, Σ H_v, and the factor φ.
fn meat(pulls: &[Pull], by_views: &DMatrix<f64>, variance: f64) -> (DMatrix<f64>, f64) {
    let n = by_views.nrows();
    let spread = pulls.iter().fold(DMatrix::zeros(n, n), |sum, pull| sum + &pull.gradient * pull.gradient.transpose());
    let level = spread.trace() / by_views.trace();
    if !(level > 0.0 && level.is_finite()) {
        return (by_views * variance, 1.0);
    }
    let towards = by_views * level;
    // The squared error of S, and its squared distance from the target: Ledoit and Wolf's b² and d².
    let fourth: f64 = pulls.iter().map(|pull| pull.gradient.norm_squared().powi(2)).sum();
    let error = fourth - spread.norm_squared() / pulls.len() as f64;
    let distance = (&spread - &towards).norm_squared();
    let share = if distance > 0.0 { (error / distance).clamp(0.0, 1.0) } else { 1.0 };
    let grown = 1.0 + (1.0 - share).powi(2) * error / towards.norm_squared();
    // Views cannot agree better than the noise of their corners lets them.
    let factor = (level / variance).max(1.0);
    ((towards * share + spread * (1.0 - share)) * (grown * factor * variance / level), factor)
}
