//! Tracks in the next pair: their places in the left view, by registration, and in the right view, by prediction.

use rayon::prelude::*;

use super::{Before, Seen, Track};
use crate::ViewPixel;
use crate::corners::Keypoint;
use crate::guided::LEVELS;
use crate::refine::register;

/// The tracks that are found again in the left view.
///
/// The shared axes hardly turn while the stages move both cameras against each other, so that a place is predicted where it was, in the
/// angles of the grid; what turns the whole rig is found by the coarser levels. The registration passes the tests of every other one:
/// correlation, certainty, and that the way back leads to where it began.
pub(super) fn followed(before: &Before, seen: &Seen<'_>) -> Vec<Track> {
    let (old, new) = (&before.grid, &seen.views.grid);
    let follow = |track: &Track| {
        let predicted = new.position_of(old.a(track.at.x), old.b(track.at.y));
        let planes = [&before.left, &seen.left];
        let found =
            register(planes, track.at, predicted, 0).or_else(|_| register(planes, track.at, predicted, LEVELS - 1));
        let at = found.ok()?.right;
        let moved = moved(before, seen, track, at);
        seen.views.shared_from_left(&Keypoint { at, level: 0 }).then_some(Track { at, moved, ..*track })
    };
    before.tracks.par_iter().filter_map(follow).collect()
}

/// From the place `at` of a track in the left view to where the right view shows a point at its range.
///
/// A point at the angle a of the left view and a' of the right one, with the baseline B, is B cos a' / sin(a - a') from the left camera.
fn moved(before: &Before, seen: &Seen<'_>, track: &Track, at: ViewPixel) -> [f64; 2] {
    let (old, new) = (&before.grid, &seen.views.grid);
    let (left, right) = (old.a(track.at.x), old.a(track.at.x + track.moved[0]));
    let inverse_range = (left - right).sin() / (before.baseline_mm * right.cos());
    let a = new.a(at.x);
    let parallax = seen.views.frame.baseline().mm() * inverse_range;
    let there = (a.sin() - parallax).atan2(a.cos());
    [new.position_of(there, new.b(at.y)).x - at.x, track.moved[1]]
}
