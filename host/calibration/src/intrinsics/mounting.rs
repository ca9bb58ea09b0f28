//! How badly a lens is mounted, by its views.
//!
//! What is known of decentring and thin prism before any view (`prior`) is that of badly mounted lenses. Of a good lens it leaves more open than
//! there is: with ten views of a symmetric lens a file would state errors of clouds a third too large. Therefore the standard deviations of that
//! prior count by a share τ between 0 and 1, whose square is the mean over all shares, equally likely before, as likely as the views make
//! them. With z the coefficients in the prior's standard deviations, L the information of the views on them and h their pull:
//!
//! ```text
//! -2 ln L(τ) = ln det (I + τ² L) - τ² hᵀ (I + τ² L)⁻¹ h
//! ```
//!
//! Views that tell nothing leave τ² at a third.

use nalgebra::SymmetricEigen;

use super::adjust::Adjusted;
use super::prior::asymmetry;

/// Shares tried.
const SHARES: u32 = 40;

/// τ, by a fit with the prior of badly mounted lenses, where the variance of a residual is `variance`. `None` where decentring and thin prism are
/// not adjusted.
pub(super) fn mounting(adjusted: &Adjusted, variance: f64) -> Option<f64> {
    let (found, left) = asymmetry(adjusted, variance)?;
    let eigen = SymmetricEigen::new(left);
    let along = eigen.eigenvectors.tr_mul(&found);
    // What is left of each direction is by the views and a prior of one standard deviation.
    let views: Vec<[f64; 2]> = eigen
        .eigenvalues
        .iter()
        .zip(&along)
        .map(|(left, found)| {
            let left = left.clamp(f64::MIN_POSITIVE, 1.0);
            [1.0 / left - 1.0, found / left]
        })
        .collect();
    let surprise = |square: f64| -> f64 {
        let of_direction = |[information, pull]: &[f64; 2]| {
            let grown = 1.0 + square * information;
            grown.ln() - square * pull * pull / grown
        };
        views.iter().map(of_direction).sum()
    };
    let squares = (0..SHARES).map(|share| ((f64::from(share) + 0.5) / f64::from(SHARES)).powi(2));
    let tried: Vec<(f64, f64)> = squares.map(|square| (square, surprise(square))).collect();
    let least = tried.iter().map(|(_, surprise)| *surprise).fold(f64::INFINITY, f64::min);
    let likely = tried.iter().map(|(square, surprise)| (square, (-0.5 * (surprise - least)).exp()));
    let (sum, all) = likely.fold((0.0, 0.0), |(sum, all), (square, weight)| (sum + square * weight, all + weight));
    Some((sum / all).sqrt()).filter(|share| share.is_finite())
}
