//! Agreement of a match with the matches around it.
//!
//! Two points of one opaque surface differ in disparity by less than they are apart: the disparity gradient limit
//! (S. Pollard, J. Mayhew and J. Frisby, "PMF: a stereo correspondence algorithm using a disparity gradient limit",
//! Perception 14, 1985). A wrong match rarely finds neighbours within it, a point of a thin object finds some.

use rayon::prelude::*;

use crate::ViewPixel;

/// How many of the nearest matches are asked.
const NEAREST: usize = 8;
/// How many of them must agree.
const SUPPORT: usize = 2;
/// Largest change of disparity per distance.
const GRADIENT_LIMIT: f64 = 0.3;
/// Disparities differing by no more than this many standard deviations agree at any distance.
const ALWAYS_AGREE_SIGMAS: f64 = 1.65;
/// Two matches within this distance show one point, in pixels.
const SAME_POINT: f64 = 2.0;

/// A match as its neighbours see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub left: ViewPixel,
    pub disparity: f64,
    pub score: f64,
    pub sigma: f64,
}

/// Whether enough of the nearest other points agree with each match.
pub(crate) fn supported(matches: &[Placed]) -> Vec<bool> {
    matches.par_iter().map(|one| support(one, matches) >= SUPPORT).collect()
}

/// Whether each match has the same place as a better one: better known, or else more alike; of equals, the earlier.
pub(crate) fn duplicated(matches: &[Placed]) -> Vec<bool> {
    let better = |i: usize, j: usize| {
        let (p, q) = (&matches[i], &matches[j]);
        distance_squared(p, q) < SAME_POINT * SAME_POINT
            && p.sigma.total_cmp(&q.sigma).then(q.score.total_cmp(&p.score)).then(i.cmp(&j)).is_gt()
    };
    (0..matches.len()).into_par_iter().map(|i| (0..matches.len()).any(|j| better(i, j))).collect()
}

fn support(one: &Placed, matches: &[Placed]) -> usize {
    let change = |other: &Placed| (other.disparity - one.disparity).abs();
    let mut nearest: Vec<(f64, &Placed)> = matches
        .iter()
        .map(|other| (distance_squared(one, other), other))
        .filter(|(squared, _)| *squared >= SAME_POINT * SAME_POINT)
        .collect();
    if nearest.len() > NEAREST {
        nearest.select_nth_unstable_by(NEAREST, |p, q| p.0.total_cmp(&q.0).then(change(p.1).total_cmp(&change(q.1))));
        nearest.truncate(NEAREST);
    }
    let agrees = |&(squared, other): &(f64, &Placed)| {
        let noise = ALWAYS_AGREE_SIGMAS * one.sigma.hypot(other.sigma);
        change(other) <= noise.max(GRADIENT_LIMIT * squared.sqrt())
    };
    nearest.into_iter().filter(agrees).count()
}

fn distance_squared(p: &Placed, q: &Placed) -> f64 {
    (p.left.x - q.left.x).powi(2) + (p.left.y - q.left.y).powi(2)
}
