//! Systematic residuals: neighbours that point the same way.

use std::collections::{BTreeMap, BTreeSet};

use vergence_vision::{ImageSize, Pixel};

use crate::residuals::Observation;

/// Mean number of corners in a patch if they are spread over the whole image.
const CORNERS_PER_PATCH: f64 = 8.0;
/// Least and greatest number of patches along the longer side of the image.
const PATCHES: [f64; 2] = [8.0, 24.0];
/// Least number of corners in a patch, for a mean and a spread.
const FEWEST_CORNERS: usize = 6;
/// Least number of views in a patch: corners of one view share the error of its pose.
const FEWEST_VIEWS: usize = 3;
/// Squared length of a mean over its variance per axis that two Gaussians exceed once in a hundred times: −2 ln 0.01.
const SIGNIFICANT: f64 = 9.21;

/// The residuals in one part of the image.
pub(crate) struct Patch {
    /// Mean position of its corners.
    pub middle: Pixel,
    /// Mean residual, in pixels.
    pub mean: [f64; 2],
    /// Variance of the mean per axis, in square pixels.
    variance: f64,
    corners: usize,
}

impl Patch {
    pub fn is_significant(&self) -> bool {
        self.square() > SIGNIFICANT * self.variance
    }

    fn square(&self) -> f64 {
        self.mean[0].powi(2) + self.mean[1].powi(2)
    }
}

/// The patches with enough corners, ordered by position.
pub(crate) fn patches(size: ImageSize, observations: &[Observation]) -> Vec<Patch> {
    let used = observations.iter().filter(|observation| observation.used).count() as f64;
    let across = (used / CORNERS_PER_PATCH).sqrt().clamp(PATCHES[0], PATCHES[1]);
    let side = f64::from(size.width.max(size.height)) / across;
    let mut by_place: BTreeMap<(i64, i64), Vec<Residual>> = BTreeMap::new();
    for observation in observations.iter().filter(|observation| observation.used) {
        if let Some(error) = observation.error {
            let place =
                ((observation.observed.v / side).floor() as i64, (observation.observed.u / side).floor() as i64);
            by_place.entry(place).or_default().push(Residual {
                view: observation.view,
                observed: observation.observed,
                error,
            });
        }
    }
    by_place.values().filter_map(|residuals| patch(residuals)).collect()
}

/// Residual of a used corner.
struct Residual {
    view: usize,
    observed: Pixel,
    error: [f64; 2],
}

fn patch(residuals: &[Residual]) -> Option<Patch> {
    let views: BTreeSet<usize> = residuals.iter().map(|residual| residual.view).collect();
    if residuals.len() < FEWEST_CORNERS || views.len() < FEWEST_VIEWS {
        return None;
    }
    let count = residuals.len() as f64;
    let mean_of = |value: fn(&Residual) -> f64| residuals.iter().map(value).sum::<f64>() / count;
    let mean = [mean_of(|r| r.error[0]), mean_of(|r| r.error[1])];
    let square = |r: &Residual| (r.error[0] - mean[0]).powi(2) + (r.error[1] - mean[1]).powi(2);
    let scatter: f64 = residuals.iter().map(square).sum();
    Some(Patch {
        middle: Pixel { u: mean_of(|r| r.observed.u), v: mean_of(|r| r.observed.v) },
        mean,
        variance: scatter / (2.0 * (count - 1.0) * count),
        corners: residuals.len(),
    })
}

/// Root mean square of the patches' mean residuals, less what noise adds: the part of the residuals that all views
/// share, in pixels. `None` without patches.
pub(crate) fn pattern_px(patches: &[Patch]) -> Option<f64> {
    let corners: usize = patches.iter().map(|patch| patch.corners).sum();
    let excess = |patch: &Patch| patch.corners as f64 * (patch.square() - 2.0 * patch.variance);
    let sum: f64 = patches.iter().map(excess).sum();
    (corners > 0).then(|| (sum / corners as f64).max(0.0).sqrt())
}

/// How alike the residuals of neighbouring corners of one image are: I of P. Moran, "Notes on continuous stochastic
/// phenomena", Biometrika 37, 1950, with one neighbour each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbours {
    /// Mean product of a residual with its neighbour's over its mean square: 0 for noise, 1 where neighbours are equal.
    pub correlation: f64,
    /// Root mean square of the residuals, in pixels.
    rms_px: f64,
    corners: usize,
}

impl Neighbours {
    /// The pattern in the residuals of the corners used; `None` without two in one view.
    pub fn of(observations: &[Observation]) -> Option<Self> {
        let mut views: BTreeMap<usize, Vec<(Pixel, [f64; 2])>> = BTreeMap::new();
        for observation in observations.iter().filter(|observation| observation.used) {
            if let Some(error) = observation.error {
                views.entry(observation.view).or_default().push((observation.observed, error));
            }
        }
        let (mut product, mut square, mut corners) = (0.0, 0.0, 0);
        for view in views.values() {
            for (index, (pixel, error)) in view.iter().enumerate() {
                let others = view.iter().enumerate().filter(|(other, _)| *other != index);
                let far = |at: &Pixel| (at.u - pixel.u).hypot(at.v - pixel.v);
                let nearest = others.map(|(_, other)| other).min_by(|a, b| far(&a.0).total_cmp(&far(&b.0)));
                if let Some((_, neighbour)) = nearest {
                    product += error[0] * neighbour[0] + error[1] * neighbour[1];
                    square += error[0].powi(2) + error[1].powi(2);
                    corners += 1;
                }
            }
        }
        let rms_px = (square / f64::from(corners)).sqrt();
        (square > 0.0).then_some(Self { correlation: product / square, rms_px, corners: corners as usize })
    }

    /// The part of the residuals that neighbours share, root mean square in pixels.
    pub fn shared_px(&self) -> f64 {
        self.correlation.max(0.0).sqrt() * self.rms_px
    }

    /// Whether more is shared than chance explains, and enough to matter: a quarter of the residual.
    pub fn is_systematic(&self) -> bool {
        /// Standard deviations of the correlation of noise, which is 1/√n at most: the two components of a residual
        /// halve its variance, and two corners that are each other's neighbours double it.
        const BEYOND_CHANCE: f64 = 4.0;
        const MATTERS: f64 = 0.25;
        self.correlation > (MATTERS * MATTERS).max(BEYOND_CHANCE / (self.corners as f64).sqrt())
    }
}

/// Root mean square of the mean residuals of the views, in pixels: the common shift of whole targets. `None` without
/// views.
pub(crate) fn target_shift_px(observations: &[Observation]) -> Option<f64> {
    let mut sums: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for observation in observations.iter().filter(|observation| observation.used) {
        if let Some([du, dv]) = observation.error {
            let [count, u, v] = sums.entry(observation.view).or_default();
            (*count, *u, *v) = (*count + 1.0, *u + du, *v + dv);
        }
    }
    let corners: f64 = sums.values().map(|[count, ..]| count).sum();
    let squares: f64 = sums.values().map(|[count, u, v]| (u * u + v * v) / count).sum();
    (corners > 0.0).then(|| (squares / corners).sqrt())
}
