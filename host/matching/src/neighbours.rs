//! The test of a match against the matches around it.
//!
//! Two points of one opaque surface differ in disparity by less than their distance in the image: the disparity
//! gradient limit (S. Pollard, J. Mayhew and J. Frisby, "PMF: a stereo correspondence algorithm using a disparity
//! gradient limit", Perception 14, 1985). A wrong match rarely has neighbours within this limit; a point of a thin
//! object has some.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::ViewPixel;

/// Number of nearest matches compared.
const NEAREST: usize = 8;
/// Number of them that must agree.
const SUPPORT: usize = 2;
/// Largest change of disparity per distance in the view.
const GRADIENT_LIMIT: f64 = 0.3;
/// Disparities that differ by up to this many standard deviations agree at any distance.
const ALWAYS_AGREE_SIGMAS: f64 = 1.65;
/// Matches within this distance, in pixels of the view, are of one point.
const SAME_POINT: f64 = 2.0;

/// A match with its disparity in pixels of the view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedMatch {
    pub left: ViewPixel,
    pub disparity: f64,
    pub score: f64,
    pub sigma: f64,
}

/// Distance in pixels of the view within which the nearest matches are sought first.
const REACH: f64 = 40.0;

/// Matches that are found by their rows.
struct ByRows<'a> {
    matches: &'a [PlacedMatch],
    /// Rows and indices, by rows.
    rows: Vec<(f64, usize)>,
}

impl<'a> ByRows<'a> {
    fn of(matches: &'a [PlacedMatch]) -> Self {
        let mut rows: Vec<(f64, usize)> = matches.iter().enumerate().map(|(j, one)| (one.left.y, j)).collect();
        rows.sort_by(|p, q| p.0.total_cmp(&q.0));
        Self { matches, rows }
    }

    /// All matches within `reach` rows of `y`, and a few more.
    fn within(&self, y: f64, reach: f64) -> impl Iterator<Item = usize> {
        let start = self.rows.partition_point(|(row, _)| *row < y - reach - 1.0);
        let end = self.rows.partition_point(|(row, _)| *row <= y + reach + 1.0);
        self.rows[start..end.max(start)].iter().map(|(_, j)| *j)
    }

    /// Squared distances and indices of the matches that `counts` accepts by both: at least the [`NEAREST`] nearest to `one`, or all.
    fn near(&self, one: &PlacedMatch, counts: impl Fn(f64, usize) -> bool) -> Vec<(f64, usize)> {
        let mut reach = REACH;
        loop {
            let placed = self.within(one.left.y, reach).map(|j| (distance_squared(one, &self.matches[j]), j));
            let mut near: Vec<(f64, usize)> = placed.filter(|&(squared, j)| counts(squared, j)).collect();
            let are_all = self.within(one.left.y, reach).count() == self.rows.len();
            if are_all || near.iter().filter(|(squared, _)| *squared <= reach * reach).count() >= NEAREST {
                near.retain(|(squared, _)| are_all || *squared <= reach * reach);
                return near;
            }
            reach *= 2.0;
        }
    }
}

/// Whether each match has enough agreeing neighbours.
pub(crate) fn supported(matches: &[PlacedMatch]) -> Vec<bool> {
    let by_rows = ByRows::of(matches);
    matches.par_iter().map(|one| support(one, &by_rows) >= SUPPORT).collect()
}

/// Whether each match is at the position of a better one. Better is the smaller standard deviation, then the higher
/// score, then the lower index.
pub(crate) fn duplicated(matches: &[PlacedMatch]) -> Vec<bool> {
    let better = |i: usize, j: usize| {
        let (p, q) = (&matches[i], &matches[j]);
        distance_squared(p, q) < SAME_POINT * SAME_POINT
            && p.sigma.total_cmp(&q.sigma).then(q.score.total_cmp(&p.score)).then(i.cmp(&j)).is_gt()
    };
    let by_rows = ByRows::of(matches);
    let row = |i: usize| matches[i].left.y;
    (0..matches.len()).into_par_iter().map(|i| by_rows.within(row(i), SAME_POINT).any(|j| better(i, j))).collect()
}

/// Distance of the disparity of each match from the plane through those of its nearest matches, in pixels of the view;
/// infinite with no other matches. Matches of another surface weigh less (P. Holland and R. Welsch, Commun. Stat. A6, 1977).
pub(crate) fn off_surface(matches: &[PlacedMatch]) -> Vec<f64> {
    let by_rows = ByRows::of(matches);
    (0..matches.len()).into_par_iter().map(|i| off_plane(i, &by_rows).unwrap_or(f64::INFINITY)).collect()
}

fn off_plane(i: usize, by_rows: &ByRows<'_>) -> Option<f64> {
    const ROUNDS: usize = 3;
    /// Distance from the plane at which the weight is halved, in pixels.
    const SCALE: f64 = 0.5;
    /// Information that keeps the slope of a plane through matches on one line small.
    const FLATNESS: f64 = 1e-3;
    let matches = by_rows.matches;
    let one = matches.get(i)?;
    let mut near = by_rows.near(one, |_, j| j != i);
    if near.len() > NEAREST {
        near.select_nth_unstable_by(NEAREST, |p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        near.truncate(NEAREST);
    }
    let row = |&(_, j): &(f64, usize)| {
        let (dx, dy) = (matches[j].left.x - one.left.x, matches[j].left.y - one.left.y);
        (Vector3::new(1.0, dx, dy), matches[j].disparity - one.disparity)
    };
    near.sort_by_key(|&(_, j)| j);
    let rows: Vec<(Vector3<f64>, f64)> = near.iter().map(row).collect();
    let mut plane = Vector3::zeros();
    for round in 0..ROUNDS {
        let (mut normal, mut right_side) =
            (Matrix3::from_diagonal(&Vector3::new(0.0, FLATNESS, FLATNESS)), Vector3::zeros());
        for (place, change) in &rows {
            let off = if round == 0 { 0.0 } else { (change - place.dot(&plane)) / SCALE };
            let weight = 1.0 / (1.0 + off * off);
            normal += place * place.transpose() * weight;
            right_side += place * (weight * change);
        }
        plane = normal.cholesky()?.solve(&right_side);
    }
    Some(plane.x.abs())
}

fn support(one: &PlacedMatch, by_rows: &ByRows<'_>) -> usize {
    let change = |other: &PlacedMatch| (other.disparity - one.disparity).abs();
    let near = by_rows.near(one, |squared, _| squared >= SAME_POINT * SAME_POINT);
    let mut nearest: Vec<(f64, &PlacedMatch)> =
        near.into_iter().map(|(squared, j)| (squared, &by_rows.matches[j])).collect();
    if nearest.len() > NEAREST {
        nearest.select_nth_unstable_by(NEAREST, |p, q| p.0.total_cmp(&q.0).then(change(p.1).total_cmp(&change(q.1))));
        nearest.truncate(NEAREST);
    }
    let agrees = |&(squared, other): &(f64, &PlacedMatch)| {
        let noise = ALWAYS_AGREE_SIGMAS * one.sigma.hypot(other.sigma);
        change(other) <= noise.max(GRADIENT_LIMIT * squared.sqrt())
    };
    nearest.into_iter().filter(agrees).count()
}

fn distance_squared(p: &PlacedMatch, q: &PlacedMatch) -> f64 {
    (p.left.x - q.left.x).powi(2) + (p.left.y - q.left.y).powi(2)
}
