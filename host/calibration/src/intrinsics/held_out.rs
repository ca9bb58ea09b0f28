//! Residuals of each half of the views, by the lens that the other half gives. The poses of the targets are fitted to the half that is judged.
//!
//! The equations of the fit to all views are sums over views: those of a half foretell its lens, and the poses of the others before that lens.
//! The residuals there are computed, not foretold, and the difference shows how far the equations hold. Where two lenses differ by little more, both
//! are fitted in steps.

use super::adjust::Adjusted;
use super::bundle::Bundle;
use super::trial::Trial;
use crate::reprojection::moved;
use crate::schur_lm::{SchurOptions, SchurProblem, solve};

/// Of fits in steps, by which residuals are told to a millionth.
const HALVES: SchurOptions = SchurOptions { relative_cost: 1e-6, ..SchurOptions::near() };

/// A sum of squared residuals of so many corners.
struct Squares {
    squares: f64,
    count: usize,
    /// By how much it is more than foretold.
    off: f64,
}

/// Root mean square residual of both halves in pixels, without steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldOut {
    pub px: f64,
    /// Share of the sum of squares by which what the equations foretell is off.
    off: f64,
}

impl HeldOut {
    /// `of` is the adjustment whose corners the trial used. `None` where a half does not determine the lens.
    pub fn foretold(trial: &Trial, of: &Adjusted) -> Option<Self> {
        let [even, odd] = [foretold(trial, of, 0)?, foretold(trial, of, 1)?];
        let squares = even.squares + odd.squares;
        let off = (even.off.abs() + odd.off.abs()) / squares;
        Some(Self { px: (squares / (even.count + odd.count) as f64).sqrt(), off })
    }

    /// Whether fits in steps would tell the same of both.
    pub fn is_told_from(&self, other: &Self) -> bool {
        /// Share of the difference.
        const LITTLE: f64 = 0.1;
        /// What the two shares may hide because deviations cancel out.
        const LEAST: f64 = 1e-3;
        (self.off + other.off).max(LEAST) <= LITTLE * (self.px / other.px - 1.0).abs()
    }
}

/// The same by fits in steps.
pub(super) fn fitted_px(trial: &Trial, of: &Adjusted) -> f64 {
    let [even, odd] = [fitted(trial, of, 0), fitted(trial, of, 1)];
    ((even.0 + odd.0) / (even.1 + odd.1) as f64).sqrt()
}

/// Of the views that are `judged`, the even or the odd ones.
fn foretold(trial: &Trial, of: &Adjusted, judged: usize) -> Option<Squares> {
    let step = trial.normal.of_blocks(|index| index % 2 != judged).step()?.shared;
    let lens = Bundle::of(&[], &trial.free).shared_plus(&trial.state.shared, step.as_slice());
    let mut sum = Squares { squares: 0.0, count: 0, off: 0.0 };
    for (index, view) in of.views.iter().enumerate().filter(|(index, _)| index % 2 == judged) {
        let (turn, cost) = trial.normal.followed(index, &step)?;
        let pose = moved(trial.state.poses.get(index)?, &turn);
        let squares = view.used().map(|corner| lens.deviation(&pose, corner).powi(2)).sum::<f64>();
        sum.squares += squares;
        sum.off += squares - 2.0 * cost;
        sum.count += view.used().count();
    }
    Some(sum).filter(|sum| sum.squares.is_finite())
}

/// The sum of squared residuals, and of how many corners.
fn fitted(trial: &Trial, of: &Adjusted, judged: usize) -> (f64, usize) {
    let half = |is_judged: bool| {
        let all = of.views.iter().zip(&trial.state.poses).enumerate();
        let chosen = all.filter(move |(index, _)| (index % 2 == judged) == is_judged);
        chosen.map(|(_, (view, pose))| (view, *pose)).unzip::<_, _, Vec<_>, Vec<_>>()
    };
    let ((views, poses), (others, other_poses)) = (half(false), half(true));
    let problem = Bundle { prior: trial.prior, ..Bundle::of(&views, &trial.free) };
    let lens = solve(&problem, trial.state.shared, poses, &HALVES).shared;
    let seen = solve(&Bundle::of(&others, &[]), lens, other_poses, &HALVES);
    (2.0 * seen.cost, others.iter().map(|view| view.used().count()).sum())
}
