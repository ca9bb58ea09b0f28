//! Tracks in the next pair: their places in the left view, by registration, and in the right view, from where they are predicted.

use rayon::prelude::*;

use super::{Before, Seen, Track};
use crate::corners::Keypoint;
use crate::guided::LEVELS;
use crate::links::{Link, Links, in_band};
use crate::refine::{Scratch, Unregistered, Warp, register, register_prepared};
use crate::{UnmatchedReason, ViewPixel};

/// The tracks that are found again in the left view, and their links.
///
/// The shared axes hardly turn while the stages move both cameras against each other, so that a place is predicted where it was, in the
/// angles of the grid; what turns the whole rig is found by the coarser levels. The registration passes the tests of every other one:
/// correlation, certainty, and that the way back leads to where it began.
pub(super) fn followed(before: &Before, seen: &Seen<'_>) -> (Vec<Track>, Links) {
    let (old, new) = (&before.grid, &seen.views.grid);
    let planes = [&before.left, &seen.left];
    let follow = |scratch: &mut Box<Scratch>, track: &Track| {
        let predicted = new.position_of(old.a(track.at.x), old.b(track.at.y));
        let mut from = |level: usize| register(scratch, planes, track.at, predicted, level);
        let at = from(0).or_else(|_| from(LEVELS - 1)).ok()?.right;
        let track = Track { at, moved: moved(before, seen, track, at), ..*track };
        // The window of the way back is the one that is registered in the right view.
        scratch.turn();
        let is_shared = seen.views.shared_from_left(&Keypoint { at, level: 0 });
        is_shared.then(|| (track, refound(scratch, seen, &track)))
    };
    let found: Vec<_> = before.tracks.par_iter().map_init(Scratch::new, follow).flatten().collect();
    found.into_iter().unzip()
}

/// The right place of a track whose left window is prepared, from where it is predicted; where that is too far off, by the coarser levels.
fn refound(scratch: &mut Scratch, seen: &Seen<'_>, track: &Track) -> Result<Link, UnmatchedReason> {
    let (planes, oversampling) = ([&seen.left, &seen.right], seen.views.oversampling());
    let in_band = |found| in_band(&found, track.at, oversampling, &seen.band);
    let [tx, ty] = track.moved;
    let start = ViewPixel { x: track.at.x + tx, y: track.at.y + ty };
    let near = register_prepared(scratch, planes, track.at, Warp { tx, ty, ..Warp::default() }).and_then(in_band);
    near.or_else(|Unregistered { reason, .. }| {
        register(scratch, planes, track.at, start, LEVELS - 1).and_then(in_band).map_err(|_| reason)
    })
}

/// From the place `at` of a track in the left view to where the right view shows a point at its range.
///
/// A point at the angle a of the left view and a' of the right one, with the baseline B, is B cos a' / sin(a - a') from the left camera.
fn moved(before: &Before, seen: &Seen<'_>, track: &Track, at: ViewPixel) -> [f64; 2] {
    let (old, new) = (&before.grid, &seen.views.grid);
    let (left, right) = (old.a(track.at.x), old.a(track.at.x + track.moved[0]));
    let inverse_range = (left - right).sin() / (before.frame.baseline().mm() * right.cos());
    let a = new.a(at.x);
    let parallax = seen.views.frame.baseline().mm() * inverse_range;
    let there = (a.sin() - parallax).atan2(a.cos());
    [new.position_of(there, new.b(at.y)).x - at.x, track.moved[1]]
}
