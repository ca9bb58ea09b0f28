//! The views as the solver sees them: checked, in an order that does not depend on the caller's, with used flags.

use std::cmp::Ordering;

use super::{IntrinsicsError, Outlier, OutlierReason};
use crate::{BoardView, Corner};

/// With fewer corners a view has next to no redundancy over its six unknowns.
pub(super) const FEWEST_CORNERS: usize = 8;
/// Two views at different tilts determine a lens; one does not (Z. Zhang, 2000, and P. Sturm and S. Maybank, 1999).
pub(super) const FEWEST_VIEWS: usize = 2;
/// Corners whose spread across their best line is below this part of the spread along it lie on a line.
const THINNEST: f64 = 0.02;

/// One corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// On the board, in millimetres.
    pub board: [f64; 2],
    /// The board's heights for unit warp along x and along y: 1 − x̂² and 1 − ŷ².
    pub bow: [f64; 2],
    pub pixel: [f64; 2],
    pub relative_sigma: f64,
    /// Its index in the caller's view.
    pub index: usize,
    pub used: bool,
}

/// One view that can be used.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    /// Its index in the caller's list.
    pub index: usize,
    pub sights: Vec<Sight>,
}

impl Sighting {
    /// Some of the corners, spread over the board: enough to find the lens and the board from afar.
    pub fn thinned(&self) -> Self {
        const ENOUGH: usize = 64;
        let stride = self.sights.len().div_ceil(ENOUGH).max(1);
        Self { index: self.index, sights: self.sights.iter().step_by(stride).copied().collect() }
    }

    pub fn used(&self) -> impl Iterator<Item = &Sight> {
        self.sights.iter().filter(|sight| sight.used)
    }
}

/// Checks `views`, sorts them by content and leaves out, with a reason for every corner, those that are too poor.
pub(super) fn sightings(views: &[BoardView]) -> Result<(Vec<Sighting>, Vec<Outlier>), IntrinsicsError> {
    if views.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::TooFewViews { views: views.len(), needed: FEWEST_VIEWS });
    }
    for (index, view) in views.iter().enumerate() {
        check(index, view)?;
    }
    let shape = BoardShape::of(views);
    let mut kept: Vec<Sighting> = Vec::new();
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
            None => kept.push(Sighting { index, sights: shape.sights(&view.corners) }),
        }
    }
    if kept.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::TooFewCorners {
            usable_views: kept.len(),
            needed_views: FEWEST_VIEWS,
            corners: FEWEST_CORNERS,
        });
    }
    kept.sort_by(|a, b| a.sights.len().cmp(&b.sights.len()).then_with(|| by_content(&a.sights, &b.sights)));
    Ok((kept, left_out))
}

fn by_content(a: &[Sight], b: &[Sight]) -> Ordering {
    let key = |s: &Sight| [s.board[0], s.board[1], s.pixel[0], s.pixel[1]];
    let values = |sights: &[Sight]| sights.iter().flat_map(key).collect::<Vec<_>>();
    compare(&values(a), &values(b))
}

fn compare(a: &[f64], b: &[f64]) -> Ordering {
    a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// Names the corner that is not a number or appears twice, on the board or in the image.
fn check(view: usize, given: &BoardView) -> Result<(), IntrinsicsError> {
    let position = |corner: &Corner| corner.board_mm;
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

/// Whether the corners on the board, all but for rounding and noise, lie on one line.
fn on_a_line(corners: &[Corner]) -> bool {
    let n = corners.len() as f64;
    let mean = |axis: usize| corners.iter().map(|c| c.board_mm[axis]).sum::<f64>() / n;
    let centre = [mean(0), mean(1)];
    let moment = |a: usize, b: usize| {
        corners.iter().map(|c| (c.board_mm[a] - centre[a]) * (c.board_mm[b] - centre[b])).sum::<f64>()
    };
    let [minor, major] = eigenvalues(moment(0, 0), moment(0, 1), moment(1, 1));
    minor <= THINNEST * THINNEST * major
}

/// Of the symmetric matrix (a b; b c), the smaller first.
fn eigenvalues(a: f64, b: f64, c: f64) -> [f64; 2] {
    let (mean, half) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
    [mean - half, mean + half]
}

/// The rectangle that all corners of all views span on the board.
struct BoardShape {
    centre: [f64; 2],
    half: [f64; 2],
}

impl BoardShape {
    fn of(views: &[BoardView]) -> Self {
        let range = |axis: usize| {
            let coordinates = || views.iter().flat_map(|v| &v.corners).map(|c| c.board_mm[axis]);
            (coordinates().fold(f64::INFINITY, f64::min), coordinates().fold(f64::NEG_INFINITY, f64::max))
        };
        let (x, y) = (range(0), range(1));
        Self { centre: [0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1)], half: [0.5 * (x.1 - x.0), 0.5 * (y.1 - y.0)] }
    }

    /// In the order of their places on the board, so that the caller's order does not matter.
    fn sights(&self, corners: &[Corner]) -> Vec<Sight> {
        let bow = |axis: usize, x: f64| 1.0 - ((x - self.centre[axis]) / self.half[axis]).powi(2);
        let mut sights: Vec<_> = corners
            .iter()
            .enumerate()
            .map(|(index, corner)| Sight {
                board: corner.board_mm,
                bow: [bow(0, corner.board_mm[0]), bow(1, corner.board_mm[1])],
                pixel: [corner.pixel.u, corner.pixel.v],
                relative_sigma: corner.relative_sigma,
                index,
                used: true,
            })
            .collect();
        sights.sort_by(|a, b| compare(&a.board, &b.board));
        sights
    }
}
