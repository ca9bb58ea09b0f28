//! How well a stage returns to its poses, by how far they are from where its mechanism puts them.
//!
//! Whatever moves a stage beside its encoder and its screws along an axis (play, a rail that yaws, a screw that is uneven) shows as readings
//! that are off by more than a step of the encoder, differently at every stage pose. What moves it otherwise (a carriage that tilts, a mount
//! that gives) shows as cameras that return to a pose turned and shifted. How far, are the standard deviations σ that the images
//! make most likely, all other unknowns integrated out (restricted maximum likelihood: H. Patterson and R. Thompson, Biometrika 58, 1971).
//! With J the information of the images and b their pull where readings and returns are taken as exact, P(σ) the information of both:
//!
//! ```text
//! -2 ln L(σ) = ln det (J + P) - ln det P - bᵀ (J + P)⁻¹ b
//! ```
//!
//! Half a dozen stage poses say little of σ. Therefore its mean counts, with all of its orders of magnitude as likely before, and not its
//! likeliest value, which would be too small.

use nalgebra::{Cholesky, DMatrix, DVector, Isometry3};

use crate::extrinsics::Fit;
use crate::reprojection::{POSE, difference};
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::unknowns::{Ordinal, Unknown};

/// Least fall of -2 ln L: readings that are as good as their encoder show it once in a hundred calibrations.
const LEAST_FALL: f64 = 6.0;
/// From one σ tried to the next.
const STEP: f64 = 1.25;
/// Values of σ tried: up to four orders of magnitude above the least one.
const TRIED: i32 = 42;
/// Times that each σ is judged anew, given the others.
const ROUNDS: usize = 3;
/// Returns that are off by no more count as exact, in radians and millimetres: images do not show it.
const EXACT: [f64; 2] = [2e-6, 1e-4];
/// What tilts a camera shifts it too: least and largest distance, in millimetres, from which a shift comes by a turn.
const LEVER_MM: [f64; 2] = [10.0, 500.0];

/// The standard deviation of a reading of each axis, where it is larger than the model states; `None` where none is.
pub(super) fn reading_sigma(model: &Model, fit: &Fit<State>) -> Option<Vec<f64>> {
    let sigma = Images::of(model, fit)?.likely(&model.reading_sigma)?;
    (sigma != model.reading_sigma).then_some(sigma)
}

/// The standard deviations of readings, which are `stated` or larger, and of returns, by the `fit` of a `model` whose returns are free;
/// `None` where returns are exact.
pub(super) fn sigma_of_returns(model: &Model, fit: &Fit<State>, stated: &[f64]) -> Option<(Vec<f64>, [f64; 2])> {
    let images = Images::of(model, fit)?;
    let mut sigma = images.likely(&[stated, &EXACT].concat())?;
    let turn = stated.len();
    if sigma[turn..].iter().zip(EXACT).all(|(sigma, exact)| *sigma <= exact) {
        return None;
    }
    // Where one of both is seen, the other is there too, though half a dozen poses may not tell it from none. What a later return will
    // be off by, has the mean of σ² for its variance.
    let mean_square = |sigma: &[f64], which: usize, least: f64| {
        images.tried(sigma, which, least).map(|tried| mean(&tried, |sigma| sigma * sigma).sqrt())
    };
    for _ in 0..ROUNDS {
        sigma[turn + 1] = mean_square(&sigma, turn + 1, sigma[turn] * LEVER_MM[0])?;
        sigma[turn] = mean_square(&sigma, turn, sigma[turn + 1] / LEVER_MM[1])?;
    }
    let returns = [sigma[turn], sigma[turn + 1]];
    sigma.truncate(turn);
    Some((sigma, returns))
}

/// What the images say, without readings and returns.
struct Images {
    /// J.
    information: DMatrix<f64>,
    /// b.
    pull: DVector<f64>,
    /// The place of each error among the unknowns, and which σ is its: one for each axis, then the turn and the shift of returns.
    errors: Vec<(usize, usize)>,
}

impl Images {
    fn of(model: &Model, fit: &Fit<State>) -> Option<Self> {
        // As the views scatter.
        let variance = (fit.sigma * fit.covariance.as_ref()?.scatter).powi(2);
        let (mut information, mut away) = (fit.information.clone(), DVector::zeros(fit.information.nrows()));
        let (mut errors, mut by_prior) = (Vec::new(), away.clone());
        let sigma = [model.reading_sigma.as_slice(), &model.return_sigma.unwrap_or(EXACT)].concat();
        let mut ordinal = Ordinal::default();
        for (place, &unknown) in model.unknowns.iter().enumerate() {
            let nth = ordinal.next(unknown);
            let state = &fit.shared.state;
            let (which, error) = match unknown {
                Unknown::Reading { pose, axis } => (axis, *state.reading_errors.get(pose)?.get(axis)?),
                Unknown::Return { pose } => {
                    let returned = difference(state.returns.get(pose)?, &Isometry3::identity());
                    (model.reading_sigma.len() + nth / 3 % 2, returned[nth % POSE])
                }
                _ => continue,
            };
            let weight = (fit.sigma_of_priors / sigma.get(which)?).powi(2);
            away[place] = error;
            information[(place, place)] -= weight;
            by_prior[place] = weight * error;
            errors.push((place, which));
        }
        // At the optimum the images pull as strongly as the prior holds.
        let pull = (by_prior + &information * away) / variance;
        Some(Self { information: information / variance, pull, errors })
    }

    /// Each σ, `least` or larger.
    fn likely(&self, least: &[f64]) -> Option<Vec<f64>> {
        let mut sigma = least.to_vec();
        for _ in 0..ROUNDS {
            for which in 0..sigma.len() {
                sigma[which] = self.most_likely(&sigma, which, least[which])?;
            }
        }
        Some(sigma)
    }

    /// -2 ln L; `None` where the unknowns are not determined.
    fn surprise(&self, sigma: &[f64]) -> Option<f64> {
        let mut total = self.information.clone();
        let mut of_prior = 0.0;
        for &(place, which) in &self.errors {
            let weight = sigma.get(which)?.powi(-2);
            total[(place, place)] += weight;
            of_prior += weight.ln();
        }
        let factor = Cholesky::new(total)?;
        let determinant = 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        Some(determinant - of_prior - self.pull.dot(&factor.solve(&self.pull)))
    }

    /// Values of the σ called `which` from `least` on, the others given, each with its -2 ln L above the lowest.
    fn tried(&self, sigma: &[f64], which: usize, least: f64) -> Option<Vec<(f64, f64)>> {
        let mut sigma = sigma.to_vec();
        let mut tried = Vec::new();
        for step in 0..TRIED {
            sigma[which] = least * STEP.powi(step);
            tried.push((sigma[which], self.surprise(&sigma)?));
        }
        let lowest = tried.iter().map(|(_, surprise)| *surprise).fold(f64::INFINITY, f64::min);
        tried.iter_mut().for_each(|(_, surprise)| *surprise -= lowest);
        Some(tried)
    }

    /// The σ called `which`, the others given: `least` where the images do not ask for more.
    fn most_likely(&self, sigma: &[f64], which: usize, least: f64) -> Option<f64> {
        let tried = self.tried(sigma, which, least)?;
        let asks = tried.first().is_some_and(|(_, as_least)| *as_least >= LEAST_FALL);
        Some(if asks { mean(&tried, |sigma| sigma) } else { least })
    }
}

/// The mean `of` values of σ whose -2 ln L are these above the lowest.
fn mean(tried: &[(f64, f64)], of: impl Fn(f64) -> f64) -> f64 {
    let weight = |surprise: f64| (-0.5 * surprise).exp();
    let all: f64 = tried.iter().map(|(_, surprise)| weight(*surprise)).sum();
    tried.iter().map(|(sigma, surprise)| of(*sigma) * weight(*surprise)).sum::<f64>() / all
}
