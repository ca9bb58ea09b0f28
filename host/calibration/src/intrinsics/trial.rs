//! A lens on trial: the fit of some of its parameters to corners that another fit used.

use std::cell::OnceCell;

use nalgebra::Isometry3;

use super::adjust::{Adjusted, State, Terms};
use super::bundle::{Bundle, Shared};
use super::observations::ObservedView;
use super::prior::{Prior, Strength};
use crate::reprojection::POSE;
use crate::schur_lm::{SchurNormal, SchurOptions, solve};

/// Of fits by which chi-squared is compared, and the scatter of the views estimated.
const COMPARED: SchurOptions = SchurOptions { relative_cost: 1e-8, ..SchurOptions::near() };
/// Of fits to halves of the views, of which residuals are told to a millionth.
const HALVES: SchurOptions = SchurOptions { relative_cost: 1e-6, ..SchurOptions::near() };

/// A fit to the corners that another one used.
pub(super) struct Trial {
    /// The parameters adjusted.
    free: Vec<usize>,
    /// How strongly the prior counts.
    prior: Option<Strength>,
    pub state: State,
    pub normal: SchurNormal<POSE>,
    held_out_px: OnceCell<f64>,
}

/// How much more the views pull the lens to and fro than noise explains; `None` where they do not determine it.
pub(super) fn scatter(normal: &SchurNormal<POSE>, prior: Prior) -> Option<f64> {
    let variance = normal.variance()?;
    Some(normal.clustered_with_priors(variance, variance * prior.factor())?.scatter)
}

impl Trial {
    /// The fit with `terms` and no others, from where `adjusted` is.
    pub fn of(adjusted: &Adjusted, terms: Terms, prior: Prior) -> Self {
        let (free, start) = (terms.free(), adjusted.state().with_only(terms));
        let references: Vec<_> = adjusted.views.iter().collect();
        // By the noise of the richer fit, which is nearer to that of the corners.
        let prior = prior.strength(&adjusted.views, &adjusted.state());
        let problem = Bundle { prior, ..Bundle::of(&references, &free) };
        let solution = solve(&problem, start.shared, start.poses, &COMPARED);
        let state = State { shared: solution.shared, poses: solution.blocks };
        Self { free, prior, state, normal: solution.normal, held_out_px: OnceCell::new() }
    }

    /// Standard deviation of a parameter where the variance of a residual is `variance`.
    pub fn sigma(&self, parameter: usize, variance: f64) -> Option<f64> {
        let index = self.free.iter().position(|&free| free == parameter)?;
        let sigma = (self.normal.shared_covariance()?[(index, index)] * variance).sqrt();
        Some(sigma).filter(|sigma| sigma.is_finite())
    }

    /// Root mean square residual in pixels over the corners that `of` used.
    pub fn rms_px(&self, of: &Adjusted) -> f64 {
        rms_px(&of.views, &self.state.shared, &self.state.poses)
    }

    /// Root mean square residual in pixels of each half of the views, by the lens that the other half gives. The poses of the targets are
    /// fitted to the half that is judged. `of` is the fit of [`Self::of`].
    pub fn held_out_px(&self, of: &Adjusted) -> f64 {
        *self.held_out_px.get_or_init(|| self.fit_halves(of))
    }

    fn fit_halves(&self, of: &Adjusted) -> f64 {
        let half = |odd: usize| {
            let chosen = of.views.iter().zip(&self.state.poses).enumerate().filter(move |(index, _)| index % 2 == odd);
            chosen.map(|(_, (view, pose))| (view, *pose)).unzip::<_, _, Vec<_>, Vec<_>>()
        };
        let halves = [half(0), half(1)];
        let (mut squares, mut count) = (0.0, 0);
        for (fitted, judged) in [(0, 1), (1, 0)] {
            let [(views, poses), (others, other_poses)] = [&halves[fitted], &halves[judged]];
            let problem = Bundle { prior: self.prior, ..Bundle::of(views, &self.free) };
            let lens = solve(&problem, self.state.shared, poses.clone(), &HALVES).shared;
            let seen = solve(&Bundle::of(others, &[]), lens, other_poses.clone(), &HALVES);
            squares += 2.0 * seen.cost;
            count += others.iter().map(|view| view.used().count()).sum::<usize>();
        }
        (squares / count as f64).sqrt()
    }
}

fn rms_px(views: &[ObservedView], shared: &Shared, poses: &[Isometry3<f64>]) -> f64 {
    let of_view = |(view, pose): (&ObservedView, &Isometry3<f64>)| {
        view.used().map(|corner| shared.residual_px(pose, corner).powi(2)).sum::<f64>()
    };
    let squares: f64 = views.iter().zip(poses).map(of_view).sum();
    (squares / views.iter().map(|view| view.used().count()).sum::<usize>() as f64).sqrt()
}
