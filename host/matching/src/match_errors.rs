//! How far a match may be off, and how probably it is wrong, from what its registration and the matches around it show.
//!
//! The errors of matches have a core and tails: a few per cent of the matches are off by more than three standard deviations of the core,
//! windows that show two surfaces. What shows these is counted into a probability by logistic regression (D. Cox, J. R. Stat. Soc. B
//! 20(2), 1958), and the least probable matches are dropped. The others state the standard deviation of the mixture of core and tail, so
//! that it is larger where a match is less probably right. All numbers were fitted to rendered pairs, see docs/measured/matching.md.

use rayon::prelude::*;
use vergence_vision::median;

use crate::UnmatchedReason;
use crate::epipolar_band::EpipolarBand;
use crate::links::{Compared, Link, Links, placed};
use crate::neighbours::off_surface;
use crate::refine::{Scratch, Warp, departures};

/// What a registration shows of its own error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// Standard deviations along the row and across it from the residuals, as if these were independent, in pixels of the view.
    pub from_residuals: [f64; 2],
    /// Root mean square of the residuals, in grey levels.
    pub residual: f64,
    /// Stretch or shear along the row, the larger of both.
    pub steepness: f64,
    /// Distance between the keypoint and the result of registering to the right view and back, in pixels of the view; infinite where the way back
    /// was not found.
    pub way_back: f64,
    /// The warp that was found.
    pub warp: Warp,
}

impl Evidence {
    /// Standard deviations along the row and across it, in pixels of the view, by the registration alone. `oversampling` is the number of
    /// pixels of the view per pixel of the image, `shortening` the length of an arc of a row relative to that on the axis: where it is
    /// short, more rows of the view show the same pixel.
    pub(crate) fn sigma(&self, oversampling: f64, shortening: f64) -> [f64; 2] {
        let repeated = (oversampling / shortening.max(SHORTEST)).sqrt();
        [0, 1].map(|i| {
            let noise = self.residual.hypot(SMALLEST_RESIDUALS[i]) / self.residual.max(f64::MIN_POSITIVE);
            let from_residuals = ERROR_FACTORS[i] * repeated * noise * self.from_residuals[i];
            from_residuals.hypot(SMALLEST_SIGMAS[i] * oversampling).hypot(BY_WAY_BACK[i] * self.way_back)
        })
    }

    /// The same for a registration that is not good to a small part of a pixel.
    pub(crate) fn unregistered_sigma(&self, oversampling: f64, shortening: f64) -> [f64; 2] {
        let repeated = (oversampling / shortening.max(SHORTEST)).sqrt();
        [0, 1].map(|i| (UNREGISTERED_FACTORS[i] * repeated * self.from_residuals[i]).hypot(SMALLEST_UNREGISTERED[i]))
    }
}

/// How much larger the errors along the row and across it are than from independent residuals, in a view as dense as the image. They grow
/// with the root of the density of the view, whose neighbouring pixels then show the same pixel of the image.
const ERROR_FACTORS: [f64; 2] = [1.3, 1.41];
/// Residuals that two views have at least, in grey levels: where both images are sampled alike, as with parallel axes, the noise that
/// they share hides in no residual.
const SMALLEST_RESIDUALS: [f64; 2] = [0.43, 0.78];
/// Smallest standard deviations of a registration, in pixels of the image: it ends with a step of up to a hundredth of a pixel of the view.
const SMALLEST_SIGMAS: [f64; 2] = [0.003, 0.004];
/// Parts of the distance of the way back that are errors along the row and across it.
const BY_WAY_BACK: [f64; 2] = [0.97, 0.7];
/// Smallest shortening that was fitted: 75 degrees from the axis it is 0.26.
const SHORTEST: f64 = 0.2;
/// Part of the distance from the surface of the matches around a match that its error along the row makes, and the largest distance
/// that counts: beyond it, the surface is another one.
const OFF_SURFACE: (f64, f64) = (0.31, 0.4);
/// Parts of the departure of the windows beside a match, the third in size of the four, that are errors along the row and across it.
const BY_DEPARTURE: [f64; 2] = [0.54, 0.15];
/// The largest departure that counts, in pixels of the view: beyond it, the surface is another one.
pub(crate) const FARTHEST_DEPARTURE: f64 = 1.0;
/// Logistic regression of the probability that a registered match is right: constant, logarithm of its residual over the median one,
/// steepness, squared distance from the epipolar plane in standard deviations, of which up to four count, and logarithm of the sum of the
/// departures and 0.05.
const REGISTERED: [f64; 5] = [4.43, -0.86, -1.7, -0.18, -0.53];
/// Squared errors of matches that are wrong, over the variances of the core: those of the fit that were within a pixel of the image, without
/// which a match would state nothing of its tail.
const WRONG: f64 = 28.0;
/// What is left of the core's standard deviations along the row and across it where [`WRONG`] counts as well.
const CORE: [f64; 2] = [0.85, 0.8];
/// Matches that are more probably wrong than right are dropped. On real photographs many that are right have less than 0.9.
const LEAST_PROBABILITY: f64 = 0.5;

/// Standard deviations of the position of an unregistered match whose registration did not converge, along the row and across it, in pixels
/// of the view: networks place keypoints on whole pixels of both views.
pub(crate) const UNREGISTERED_SIGMA: [f64; 2] = [1.2, 0.8];
/// As [`ERROR_FACTORS`], where a registration ended that is not good to a small part of a pixel, and the smallest standard deviations there, in
/// pixels of the view. These errors have long tails: the standard deviations are such that 95 % are within two.
const UNREGISTERED_FACTORS: [f64; 2] = [3.4, 1.7];
const SMALLEST_UNREGISTERED: [f64; 2] = [0.15, 0.1];
/// As [`OFF_SURFACE`], for matches where their registration ended, and at keypoints.
const ENDED_OFF: (f64, f64) = (0.18, 3.0);
const KEYPOINTS_OFF: (f64, f64) = (0.7, 20.0);
/// As [`FARTHEST_DEPARTURE`], for unregistered matches.
const FARTHEST_UNREGISTERED_DEPARTURE: f64 = 2.0;
/// Logistic regression of the probability that a match is right where its registration ended: constant, logarithm of the odds that the
/// networks state, distance from the epipolar plane in pixels of the view, and logarithm of its residual over the median one.
const WHERE_ENDED: [f64; 4] = [4.1, 0.11, -1.3, -1.34];
/// The largest such distance that counts.
const FARTHEST_OFF_PLANE: f64 = 1.5;
/// The same at keypoints: constant, and factor of the logarithm of the odds.
const AT_KEYPOINTS: [f64; 2] = [1.2, 0.4];
/// Less probable unregistered matches are dropped: they are off by so much that no standard deviation for all of them would hold.
const LEAST_UNREGISTERED_PROBABILITY: f64 = 0.93;

/// Completes the standard deviations and states the probability of each link, from the links and the windows around it, which are registered
/// unless a link knows its departures already. Links that are too probably wrong are dropped.
pub(crate) fn state_errors(links: &mut Links, compared: &Compared<'_>, band: &EpipolarBand) {
    let mut off = vec![0.0; links.len()];
    let linked = off.iter_mut().zip(links.iter()).filter(|(_, link)| link.is_ok());
    linked.zip(off_surface(&placed(links, compared.keypoints))).for_each(|((off, _), found)| *off = found);
    let residuals = |links: &[&Link]| median(links.iter().filter_map(|link| Some(link.evidence?.residual)).collect());
    let all: Vec<&Link> = links.iter().flatten().collect();
    let registered: Vec<&Link> = all.iter().copied().filter(|link| link.registered).collect();
    let usual = residuals(&registered).or_else(|| residuals(&all)).unwrap_or_default();
    let views = [compared.left, compared.right];
    links.par_iter_mut().zip(compared.keypoints).zip(off).for_each_init(
        Scratch::new,
        |scratch, ((link, keypoint), off)| {
            *link = link.and_then(|mut link| {
                let evidence = link.evidence;
                let measured = |evidence: Evidence| departures(scratch, views, keypoint.at, &evidence.warp);
                let mut departures = link.departures.unwrap_or_else(|| evidence.map_or([0.0; 4], measured));
                link.departures = Some(departures);
                departures.sort_by(f64::total_cmp);
                let Some(evidence) = evidence.filter(|_| link.registered) else {
                    return state_unregistered(link, usual, off, departures[2], band.shortening(keypoint.at));
                };
                let departures = departures.map(|departure| departure.min(FARTHEST_DEPARTURE));
                link.right_probability = registered_probability(&link, &evidence, usual, departures.iter().sum());
                if link.right_probability < LEAST_PROBABILITY {
                    return Err(UnmatchedReason::TwoSurfaces);
                }
                let [along, across] = BY_DEPARTURE.map(|part| part * departures[2]);
                link.sigma[0] = link.sigma[0].hypot(OFF_SURFACE.0 * off.min(OFF_SURFACE.1)).hypot(along);
                link.sigma[1] = link.sigma[1].hypot(across * band.shortening(keypoint.at));
                let with_tail = with_tail(link.right_probability);
                link.sigma = [0, 1].map(|i| CORE[i] * with_tail * link.sigma[i]);
                Ok(link)
            });
        },
    );
}

/// The standard deviations and the probability of a link without registration, `off` the surface around it, whose windows beside it depart by
/// `departure`.
fn state_unregistered(
    mut link: Link,
    usual: f64,
    off: f64,
    departure: f64,
    shortening: f64,
) -> Result<Link, UnmatchedReason> {
    let off_plane = (link.off_plane * link.sigma[1]).min(FARTHEST_OFF_PLANE);
    link.right_probability = unregistered_probability(&link, usual, off_plane);
    if link.right_probability < LEAST_UNREGISTERED_PROBABILITY {
        return Err(UnmatchedReason::Doubtful);
    }
    let (factor, farthest) = if link.evidence.is_some() { ENDED_OFF } else { KEYPOINTS_OFF };
    let [along, across] = BY_DEPARTURE.map(|part| part * departure.min(FARTHEST_UNREGISTERED_DEPARTURE));
    link.sigma[0] = link.sigma[0].hypot(factor * off.min(farthest)).hypot(along);
    link.sigma[1] = link.sigma[1].hypot(across * shortening);
    Ok(link)
}

fn registered_probability(link: &Link, evidence: &Evidence, usual: f64, departures: f64) -> f64 {
    let [constant, by_residual, by_steepness, by_distance, by_departures] = REGISTERED;
    let residual = (evidence.residual / usual.max(f64::MIN_POSITIVE)).max(0.1).ln();
    let distance = link.off_plane.min(4.0).powi(2);
    let departed = (departures + 0.05).ln();
    let shown = by_residual * residual + by_steepness * evidence.steepness + by_distance * distance;
    logistic(constant + shown + by_departures * departed)
}

/// How much larger the standard deviation of a match is than that of its core, by the probability that it is right: that of the mixture
/// of both.
fn with_tail(right: f64) -> f64 {
    (right + (1.0 - right) * WRONG).sqrt()
}

fn unregistered_probability(link: &Link, usual: f64, off_plane: f64) -> f64 {
    let score = link.score.clamp(1e-6, 1.0 - 1e-6);
    let odds = (score / (1.0 - score)).ln();
    let Some(evidence) = link.evidence else {
        let [constant, by_odds] = AT_KEYPOINTS;
        return logistic(constant + by_odds * odds);
    };
    let [constant, by_odds, by_distance, by_residual] = WHERE_ENDED;
    let residual = (evidence.residual / usual.max(f64::MIN_POSITIVE)).max(0.1).ln();
    logistic(constant + by_odds * odds + by_distance * off_plane + by_residual * residual)
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}
