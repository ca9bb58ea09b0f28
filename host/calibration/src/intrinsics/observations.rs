//! Observed corners, checked and sorted so that results do not depend on the caller's order.

use std::cmp::Ordering;
use vergence_targets::{Corner, TargetView};

use super::{IntrinsicsError, Outlier, OutlierReason};
use crate::TargetShape;

/// Least number of corners in a view: fewer leave little redundancy over its six unknowns.
pub(super) const FEWEST_CORNERS: usize = 8;
/// Least number of views: two at different tilts determine a lens, one does not (Z. Zhang, 2000, and P. Sturm and S.
/// Maybank, 1999).
pub(super) const FEWEST_VIEWS: usize = 2;
/// Corners lie on a line if their spread across it is below this share of the spread along it.
const THINNEST: f64 = 0.02;

/// One observed corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    /// Position on the target, in millimetres.
    pub target: [f64; 2],
    /// Height of the target here for a unit bow along x and along y: 1 − x̂² and 1 − ŷ².
    pub bow: [f64; 2],
    pub pixel: [f64; 2],
    pub relative_sigma: f64,
    /// Index in the caller's view.
    pub index: usize,
    pub used: bool,
}

/// The observations of one usable view.
#[derive(Clone, Debug)]
pub(super) struct ObservedView {
    /// Index in the caller's list.
    pub index: usize,
    pub observations: Vec<Observation>,
}

impl ObservedView {
    /// A subset of the corners, spread over the target: enough for a start.
    pub fn thinned(&self) -> Self {
        const ENOUGH: usize = 64;
        let stride = self.observations.len().div_ceil(ENOUGH).max(1);
        Self { index: self.index, observations: self.observations.iter().step_by(stride).copied().collect() }
    }

    pub fn used(&self) -> impl Iterator<Item = &Observation> {
        self.observations.iter().filter(|observation| observation.used)
    }
}

/// Checks `views`, sorts them by content, and leaves out views that are too poor, with a reason for every corner.
pub(super) fn observed_views(views: &[TargetView]) -> Result<(Vec<ObservedView>, Vec<Outlier>), IntrinsicsError> {
    if views.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::TooFewViews { views: views.len(), needed: FEWEST_VIEWS });
    }
    for (index, view) in views.iter().enumerate() {
        check(index, view)?;
    }
    let shape = TargetShape::over(views.iter().flat_map(|view| &view.corners));
    let mut kept: Vec<ObservedView> = Vec::new();
    let mut left_out = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let reason = match view.corners.len() {
            n if n < FEWEST_CORNERS => Some(OutlierReason::ViewTooSmall),
            _ if on_a_line(&view.corners) => Some(OutlierReason::ViewOnALine),
            _ => None,
        };
        match reason {
            Some(reason) => left_out.extend((0..view.corners.len()).map(|corner| Outlier {
                view: index,
                corner,
                residual_px: None,
                reason,
            })),
            None => kept.push(ObservedView { index, observations: observations(&shape, &view.corners) }),
        }
    }
    if kept.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::TooFewCorners {
            usable_views: kept.len(),
            needed_views: FEWEST_VIEWS,
            corners: FEWEST_CORNERS,
        });
    }
    kept.sort_by(|a, b| {
        a.observations.len().cmp(&b.observations.len()).then_with(|| by_content(&a.observations, &b.observations))
    });
    Ok((kept, left_out))
}

fn by_content(a: &[Observation], b: &[Observation]) -> Ordering {
    let key = |s: &Observation| [s.target[0], s.target[1], s.pixel[0], s.pixel[1]];
    let values = |observations: &[Observation]| observations.iter().flat_map(key).collect::<Vec<_>>();
    compare(&values(a), &values(b))
}

fn compare(a: &[f64], b: &[f64]) -> Ordering {
    a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// Refuses a corner that is not finite or appears twice, on the target or in the image.
fn check(view: usize, given: &TargetView) -> Result<(), IntrinsicsError> {
    let position = |corner: &Corner| corner.target_mm;
    let pixel = |corner: &Corner| [corner.pixel.u, corner.pixel.v];
    if let Some(corner) = given.corners.iter().position(|corner| !corner.is_usable()) {
        return Err(IntrinsicsError::NotFinite { view, corner });
    }
    let twice = |key: &dyn Fn(&Corner) -> [f64; 2]| {
        // Adding zero makes −0 and 0 the same.
        let mut keys: Vec<_> = given.corners.iter().enumerate().map(|(i, c)| (key(c).map(|x| x + 0.0), i)).collect();
        keys.sort_by(|(a, i), (b, j)| compare(a, b).then(i.cmp(j)));
        keys.windows(2).find(|pair| compare(&pair[0].0, &pair[1].0).is_eq()).map(|pair| pair[1].1)
    };
    match twice(&position).or_else(|| twice(&pixel)) {
        Some(corner) => Err(IntrinsicsError::DuplicateCorner { view, corner }),
        None => Ok(()),
    }
}

/// Whether the corners lie on one line of the target, to within rounding and noise.
fn on_a_line(corners: &[Corner]) -> bool {
    let n = corners.len() as f64;
    let mean = |axis: usize| corners.iter().map(|c| c.target_mm[axis]).sum::<f64>() / n;
    let centre = [mean(0), mean(1)];
    let moment = |a: usize, b: usize| {
        corners.iter().map(|c| (c.target_mm[a] - centre[a]) * (c.target_mm[b] - centre[b])).sum::<f64>()
    };
    let [minor, major] = eigenvalues(moment(0, 0), moment(0, 1), moment(1, 1));
    minor <= THINNEST * THINNEST * major
}

/// Eigenvalues of the symmetric matrix (a b; b c), the smaller first.
fn eigenvalues(a: f64, b: f64, c: f64) -> [f64; 2] {
    let (mean, half) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
    [mean - half, mean + half]
}

/// The observations of one view of a target, ordered by position on it so that the caller's order does not matter.
fn observations(shape: &TargetShape, corners: &[Corner]) -> Vec<Observation> {
    let observation = |(index, corner): (usize, &Corner)| Observation {
        target: corner.target_mm,
        bow: shape.bow(corner.target_mm),
        pixel: [corner.pixel.u, corner.pixel.v],
        relative_sigma: corner.relative_sigma,
        index,
        used: true,
    };
    let mut observations: Vec<_> = corners.iter().enumerate().map(observation).collect();
    observations.sort_by(|a, b| compare(&a.target, &b.target));
    observations
}
