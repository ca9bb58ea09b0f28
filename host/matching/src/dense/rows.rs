//! Where the rows of both views lie, as the images show it.
//!
//! An error of the pose moves the right view across its rows: the search along rows then compares different surfaces.
//! The movement is smooth, that of a turn of the right camera and of a change of the baseline's direction, five
//! parameters in all ([`Consensus`]). It follows from places spread over the shared field: each is found along its row
//! at a coarse level, where the movement is a part of a pixel, and registered in both directions up to the finest one.

use rayon::prelude::*;
use vergence_vision::{Angle, Left, Right, Transform, median};

use super::levels::Levels;
use crate::consensus::{BearingPair, Consensus};
use crate::refine::{self, Scratch};
use crate::wrong_pose::ANY_POSE;
use crate::{Grid, SharedFrame, ViewPixel};

/// Distance of the places in columns and rows, in pixels of the coarsest level.
const SPACING: usize = 8;
/// Smallest number of places.
const LEAST: usize = 30;
/// Median distance of the partners from their rows, in pixels, that the search bears.
const BEARABLE: f64 = 0.15;
/// The rows are moved if that makes the median distance smaller than this part of it.
const BETTER: f64 = 0.7;

/// A place in both views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sighting {
    pub left: ViewPixel,
    pub right: ViewPixel,
    /// Standard deviation of `right` across its row, in pixels of the view.
    pub sigma: f64,
}

/// Pixels of a view of the dense search per pixel of the image.
const OVERSAMPLING: f64 = 1.0;

/// Finds places of the left view in the right one, on their row or a few pixels off it.
pub(super) fn sightings(levels: &Levels) -> Vec<Sighting> {
    let (level, disparities) = levels.swept_coarsely();
    let Some(plane) = levels.planes()[0].levels().get(level) else { return Vec::new() };
    let (width, scale) = (plane.width(), (1_usize << level) as f64);
    let places: Vec<_> = (SPACING / 2..plane.height())
        .step_by(SPACING)
        .flat_map(|y| (SPACING / 2..width).step_by(SPACING).map(move |x| (x, y)))
        .filter(|(x, y)| disparities[y * width + x].is_finite())
        .collect();
    let sighted = |scratch: &mut Box<Scratch>, &(x, y): &(usize, usize)| {
        let left = ViewPixel { x: x as f64 * scale, y: y as f64 * scale };
        let start = ViewPixel { x: left.x - f64::from(disparities[y * width + x]) * scale, y: left.y };
        let found = refine::register(scratch, levels.planes(), left, start, level).ok()?;
        let [_, sigma] = found.evidence.sigma(OVERSAMPLING, 1.0);
        Some(Sighting { left, right: found.right, sigma })
    };
    places.par_iter().map_init(Scratch::new, sighted).flatten().collect()
}

/// The pose whose rows are where the images show them, if those of `pose` are too far off for the search.
pub(super) fn pose_of_rows(
    sightings: &[Sighting],
    grid: &Grid,
    frame: &SharedFrame,
    pose: &Transform<Left, Right>,
) -> Option<Transform<Left, Right>> {
    let bearings = |it: &Sighting| {
        let sigma = Angle::from_rad(it.sigma / grid.pixels_per_radian());
        Some(BearingPair { left: grid.bearing(it.left)?, right: grid.bearing(it.right)?, sigma })
    };
    let pairs: Vec<_> = sightings.iter().filter_map(bearings).collect();
    if pairs.len() < LEAST {
        return None;
    }
    let distance = |consensus: &Consensus| {
        let off = pairs.iter().filter_map(|pair| consensus.off_plane(pair)).map(|(off, _)| off.rad()).collect();
        median(off).map_or(f64::INFINITY, |median| median * grid.pixels_per_radian())
    };
    let stated = distance(&Consensus::of(&pairs, Angle::from_rad(0.0)));
    if stated <= BEARABLE {
        return None;
    }
    let seen = Consensus::of(&pairs, ANY_POSE);
    (distance(&seen) < BETTER * stated).then(|| seen.pose(frame, pose))
}
