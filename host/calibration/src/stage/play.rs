//! The play of each axis, from how far its readings are from where the images put it.
//!
//! Whatever moves a stage beside its encoder and its screws (play, a rail that yaws, a screw that is uneven) shows as readings that are off by
//! more than a step of the encoder, differently at every stage pose. How far, is the standard deviation σ of a reading that the images
//! make most likely, all other unknowns integrated out (restricted maximum likelihood: H. Patterson and R. Thompson, Biometrika 58, 1971).
//! With J the information of the images and b their pull where the readings are taken at their word, P(σ) the information of the readings:
//!
//! ```text
//! -2 ln L(σ) = ln det (J + P) - ln det P - bᵀ (J + P)⁻¹ b
//! ```
//!
//! Half a dozen stage poses say little of σ. Therefore its mean counts, with all of its orders of magnitude as likely before, and not its
//! likeliest value, which would be too small.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::extrinsics::Fit;
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::unknowns::Unknown;

/// Least fall of -2 ln L: readings that are as good as their encoder show it once in a hundred calibrations.
const LEAST_FALL: f64 = 6.0;
/// From one σ tried to the next.
const STEP: f64 = 1.25;
/// Values of σ tried: up to four orders of magnitude above the stated one.
const TRIED: i32 = 42;
/// Times that each axis is judged anew, given the others.
const ROUNDS: usize = 3;

/// The standard deviation of a reading of each axis, where it is larger than the model states; `None` where none is.
pub(super) fn reading_sigma(model: &Model, fit: &Fit<State>) -> Option<Vec<f64>> {
    let images = Images::of(model, fit)?;
    let mut sigma = model.reading_sigma.clone();
    for _ in 0..ROUNDS {
        for axis in 0..sigma.len() {
            sigma[axis] = images.most_likely(&sigma, axis, model.reading_sigma[axis])?;
        }
    }
    (sigma != model.reading_sigma).then_some(sigma)
}

/// What the images say, without the readings.
struct Images {
    /// J.
    information: DMatrix<f64>,
    /// b.
    pull: DVector<f64>,
    /// The place of each reading among the unknowns, and its axis.
    readings: Vec<(usize, usize)>,
}

impl Images {
    fn of(model: &Model, fit: &Fit<State>) -> Option<Self> {
        // As the views scatter.
        let variance = (fit.sigma * fit.covariance.as_ref()?.scatter).powi(2);
        let (mut information, mut errors) = (fit.information.clone(), DVector::zeros(fit.information.nrows()));
        let (mut readings, mut by_readings) = (Vec::new(), errors.clone());
        for (place, unknown) in model.unknowns.iter().enumerate() {
            let Unknown::Reading { pose, axis } = *unknown else { continue };
            let weight = (fit.sigma_of_priors / model.reading_sigma.get(axis)?).powi(2);
            errors[place] = *fit.shared.state.reading_errors.get(pose)?.get(axis)?;
            information[(place, place)] -= weight;
            by_readings[place] = weight * errors[place];
            readings.push((place, axis));
        }
        // At the optimum the images pull as strongly as the readings hold.
        let pull = (by_readings + &information * errors) / variance;
        Some(Self { information: information / variance, pull, readings })
    }

    /// -2 ln L; `None` where the unknowns are not determined.
    fn surprise(&self, sigma: &[f64]) -> Option<f64> {
        let mut total = self.information.clone();
        let mut of_readings = 0.0;
        for &(place, axis) in &self.readings {
            let weight = sigma.get(axis)?.powi(-2);
            total[(place, place)] += weight;
            of_readings += weight.ln();
        }
        let factor = Cholesky::new(total)?;
        let determinant = 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        Some(determinant - of_readings - self.pull.dot(&factor.solve(&self.pull)))
    }

    /// The standard deviation of a reading of `axis`, the others given: `stated` where the images do not ask for more.
    fn most_likely(&self, sigma: &[f64], axis: usize, stated: f64) -> Option<f64> {
        let tried: Vec<(f64, f64)> = (0..TRIED)
            .map(|step| {
                let mut sigma = sigma.to_vec();
                sigma[axis] = stated * STEP.powi(step);
                Some((sigma[axis], self.surprise(&sigma)?))
            })
            .collect::<Option<_>>()?;
        let least = tried.iter().map(|(_, surprise)| *surprise).fold(f64::INFINITY, f64::min);
        if tried.first().is_none_or(|(_, as_stated)| as_stated - least < LEAST_FALL) {
            return Some(stated);
        }
        let likely = || tried.iter().map(|(sigma, surprise)| (sigma, (-0.5 * (surprise - least)).exp()));
        let all: f64 = likely().map(|(_, weight)| weight).sum();
        Some(likely().map(|(sigma, weight)| sigma * weight).sum::<f64>() / all)
    }
}
