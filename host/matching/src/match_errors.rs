//! How far a match may be off, and how probably it is wrong, from what its registration and the matches around it show.
//!
//! The errors of matches have a core and tails. The standard deviations are those of the core; a few per cent of the matches are off by
//! more than three of them: windows that show two surfaces. What shows these is counted into a probability by logistic regression (D.
//! Cox, J. R. Stat. Soc. B 20(2), 1958). All numbers were fitted to rendered pairs, see docs/measured/matching.md.

use crate::corners::Keypoint;
use crate::links::{Link, Links, placed};
use crate::neighbours::off_surface;

/// What a registration shows of its own error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// Standard deviations along the row and across it from the residuals, as if these were independent, in pixels of the view.
    pub from_residuals: [f64; 2],
    /// Root mean square of the residuals, in grey levels.
    pub residual: f64,
    /// Stretch or shear along the row, the larger of both.
    pub steepness: f64,
}

impl Evidence {
    /// Standard deviations along the row and across it, in pixels of the view, by the registration alone. `oversampling` is the number of
    /// pixels of the view per pixel of the image.
    pub(crate) fn sigma(&self, oversampling: f64) -> [f64; 2] {
        [0, 1].map(|i| {
            let from_residuals = ERROR_FACTORS[i] * oversampling.sqrt() * self.from_residuals[i];
            from_residuals.hypot(SMALLEST_SIGMAS[i] * oversampling)
        })
    }
}

/// How much larger the errors along the row and across it are than from independent residuals, in a view as dense as the image. They grow
/// with the root of the density of the view, whose neighbouring pixels then show the same pixel of the image.
const ERROR_FACTORS: [f64; 2] = [1.75, 1.65];
/// Smallest standard deviations of a registration, in pixels of the image: it ends with a step of up to a hundredth of a pixel of the view.
const SMALLEST_SIGMAS: [f64; 2] = [0.01, 0.02];
/// Part of the distance from the surface of the matches around a match that its error along the row makes, and the largest distance
/// that counts: beyond it, the surface is another one.
const OFF_SURFACE: (f64, f64) = (0.6, 0.4);
/// Logistic regression of the probability that a registered match is right: constant, logarithm of its residual over the median one,
/// steepness, squared distance from the epipolar plane in standard deviations, of which up to four count.
const REGISTERED: [f64; 4] = [4.7, -1.15, -5.5, -0.24];

/// Standard deviations of the position of an unregistered match along the row and across it, in pixels of the view: networks place
/// keypoints on whole pixels of both views.
pub(crate) const UNREGISTERED_SIGMA: [f64; 2] = [0.8, 0.8];
/// As [`OFF_SURFACE`], for unregistered matches, of which some are wrong.
const UNREGISTERED_OFF: (f64, f64) = (0.7, 20.0);
/// The probability that an unregistered match is right: constant, and factor of the logarithm of the odds that the networks state.
const UNREGISTERED: [f64; 2] = [2.0, 0.4];

/// Completes the standard deviations and states the probability of each link, from the links around it.
pub(crate) fn state_errors(links: &mut Links, keypoints: &[Keypoint]) {
    let surface = off_surface(&placed(links, keypoints));
    let mut residuals: Vec<f64> = links.iter().flatten().filter_map(|link| Some(link.evidence?.residual)).collect();
    residuals.sort_by(f64::total_cmp);
    let usual = residuals.get(residuals.len() / 2).copied().unwrap_or_default();
    for (link, off) in links.iter_mut().flatten().zip(surface) {
        let part = |(factor, farthest): (f64, f64)| factor * off.min(farthest);
        let along = link.sigma[0];
        (link.sigma[0], link.right_probability) = match link.evidence {
            Some(evidence) => (along.hypot(part(OFF_SURFACE)), registered_probability(link, &evidence, usual)),
            None => (along.hypot(part(UNREGISTERED_OFF)), unregistered_probability(link)),
        };
    }
}

fn registered_probability(link: &Link, evidence: &Evidence, usual: f64) -> f64 {
    let [constant, by_residual, by_steepness, by_distance] = REGISTERED;
    let residual = (evidence.residual / usual.max(f64::MIN_POSITIVE)).max(0.1).ln();
    let distance = link.off_plane.min(4.0).powi(2);
    logistic(constant + by_residual * residual + by_steepness * evidence.steepness + by_distance * distance)
}

fn unregistered_probability(link: &Link) -> f64 {
    let [constant, by_odds] = UNREGISTERED;
    let score = link.score.clamp(1e-6, 1.0 - 1e-6);
    logistic(constant + by_odds * (score / (1.0 - score)).ln())
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}
