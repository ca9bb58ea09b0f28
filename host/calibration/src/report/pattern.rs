//! What of the residuals is not noise: neighbours that point the same way.

use std::collections::{BTreeMap, BTreeSet};

use vergence_vision::{ImageSize, Pixel};

use super::residuals::Sight;

/// A patch holds about so many corners if they are all over the image, but
const CORNERS_PER_PATCH: f64 = 8.0;
/// the longer side of the image is divided into so many patches at least and at most.
const PATCHES: [f64; 2] = [8.0, 24.0];
/// A patch needs so many corners for a mean and a spread.
const FEWEST_CORNERS: usize = 6;
/// Corners of one view share the error of its pose: a mean of fewer views says nothing of the lens.
const FEWEST_VIEWS: usize = 3;
/// Squared length of a mean over its variance per axis that two Gaussians exceed once in a hundred times: −2 ln 0.01.
const SIGNIFICANT: f64 = 9.21;

/// The corners in one part of the image.
pub(super) struct Patch {
    /// Where its corners are, on average.
    pub middle: Pixel,
    /// Of the residuals, in pixels.
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

/// The patches with enough corners, by place.
pub(super) fn patches(size: ImageSize, sights: &[Sight]) -> Vec<Patch> {
    let used = sights.iter().filter(|sight| sight.used).count() as f64;
    let across = (used / CORNERS_PER_PATCH).sqrt().clamp(PATCHES[0], PATCHES[1]);
    let side = f64::from(size.width.max(size.height)) / across;
    let mut by_place: BTreeMap<(i64, i64), Vec<Residual>> = BTreeMap::new();
    for sight in sights.iter().filter(|sight| sight.used) {
        if let Some(error) = sight.error {
            let place = ((sight.seen.v / side).floor() as i64, (sight.seen.u / side).floor() as i64);
            by_place.entry(place).or_default().push(Residual { view: sight.view, seen: sight.seen, error });
        }
    }
    by_place.values().filter_map(|residuals| patch(residuals)).collect()
}

/// A residual of a corner used.
struct Residual {
    view: usize,
    seen: Pixel,
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
        middle: Pixel { u: mean_of(|r| r.seen.u), v: mean_of(|r| r.seen.v) },
        mean,
        variance: scatter / (2.0 * (count - 1.0) * count),
        corners: residuals.len(),
    })
}

/// Root mean square of the patches' means after what noise adds to them: the part of the residuals that agrees with its
/// neighbours, in pixels. `None` without patches.
pub(super) fn pattern_px(patches: &[Patch]) -> Option<f64> {
    let corners: usize = patches.iter().map(|patch| patch.corners).sum();
    let excess = |patch: &Patch| patch.corners as f64 * (patch.square() - 2.0 * patch.variance);
    let sum: f64 = patches.iter().map(excess).sum();
    (corners > 0).then(|| (sum / corners as f64).max(0.0).sqrt())
}

/// Root mean square of the mean residuals of the views, in pixels: how far boards are off as a whole. `None` of none.
pub(super) fn board_shift_px(sights: &[Sight]) -> Option<f64> {
    let mut sums: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for sight in sights.iter().filter(|sight| sight.used) {
        if let Some([du, dv]) = sight.error {
            let [count, u, v] = sums.entry(sight.view).or_default();
            (*count, *u, *v) = (*count + 1.0, *u + du, *v + dv);
        }
    }
    let corners: f64 = sums.values().map(|[count, ..]| count).sum();
    let squares: f64 = sums.values().map(|[count, u, v]| (u * u + v * v) / count).sum();
    (corners > 0.0).then(|| (squares / corners).sqrt())
}
