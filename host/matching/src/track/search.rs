//! The search for new tracks, strip by strip.

use std::ops::Range;

use rayon::prelude::*;

use super::{Seen, Track};
use crate::UnmatchedReason;
use crate::corners::{Keypoint, detect_within};
use crate::epipolar_band::EpipolarBand;
use crate::guided::{Features, compare};
use crate::links::{Compared, Link, Links, Rows};

/// Nearer to a track than this, in pixels of the view, a corner is the same point.
const SAME_POINT: f64 = 5.0;
/// Rows beside a strip whose corners are compared as well: partners lie there, and rivals.
const BESIDE: usize = 24;

/// Some rows of the views.
pub(super) struct Strip {
    rows: Range<usize>,
    height: usize,
    pub is_whole: bool,
}

impl Strip {
    /// Number of strips of a view: all of it is searched in so many pairs, or in half as many where tracks are few.
    pub(super) const COUNT: usize = 12;

    pub(super) const fn whole(height: usize) -> Self {
        Self { rows: 0..height, height, is_whole: true }
    }

    /// The strips of these `numbers`, of a view of `height` rows.
    pub(super) fn new(numbers: Range<usize>, height: usize) -> Self {
        let rows = numbers.start * height / Self::COUNT..numbers.end.min(Self::COUNT) * height / Self::COUNT;
        Self { rows, height, is_whole: false }
    }

    fn holds(&self, keypoint: &Keypoint) -> bool {
        self.is_whole || (self.rows.start as f64..self.rows.end as f64).contains(&keypoint.at.y)
    }

    fn with_surroundings(&self) -> Range<usize> {
        self.rows.start.saturating_sub(BESIDE)..(self.rows.end + BESIDE).min(self.height)
    }

    /// Drops links of this strip whose pattern a view repeats. Tracks of the other strips passed this test when theirs was searched.
    pub(super) fn drop_repeated(&self, links: &mut Links, compared: &Compared<'_>, band: &EpipolarBand) {
        let inside: Vec<usize> = (0..links.len()).filter(|&i| self.holds(&compared.keypoints[i])).collect();
        let mut of_strip: Links = inside.iter().map(|&i| links[i]).collect();
        let keypoints: Vec<Keypoint> = inside.iter().map(|&i| compared.keypoints[i]).collect();
        Rows::within(compared, &self.with_surroundings()).drop_repeated(&mut of_strip, &keypoints, band);
        inside.into_iter().zip(of_strip).for_each(|(i, link)| links[i] = link);
    }
}

/// A new keypoint, and its partner or why it has none.
type Sought = (Keypoint, Result<Link, UnmatchedReason>);

/// The corners of a strip that are no tracks yet, each with its candidate, and the number of corners of the right view. A whole view has at
/// most `budget` corners.
pub(super) fn newly_found(seen: &Seen<'_>, tracks: &[Track], strip: &Strip, budget: usize) -> (Vec<Sought>, usize) {
    let rows = strip.with_surroundings();
    let share = budget * rows.len() / strip.height.max(1);
    let of_left = || {
        let found = detect_within(&seen.left, rows.clone(), share, |keypoint| seen.views.shared_from_left(keypoint));
        Features::of(&seen.left, found)
    };
    let of_right = || {
        let found = detect_within(&seen.right, rows.clone(), share, |keypoint| seen.views.shared_from_right(keypoint));
        Features::of(&seen.right, found)
    };
    let (left, right) = rayon::join(of_left, of_right);
    let links = compare(&left, &right, &seen.band);
    let is_new = |keypoint: &Keypoint| {
        let near = |track: &Track| {
            let (dx, dy) = (track.at.x - keypoint.at.x, track.at.y - keypoint.at.y);
            dx * dx + dy * dy < SAME_POINT * SAME_POINT
        };
        strip.holds(keypoint) && !tracks.iter().any(near)
    };
    let new = left.keypoints.into_par_iter().zip(links).filter(|(keypoint, _)| is_new(keypoint)).collect();
    (new, right.keypoints.len())
}
