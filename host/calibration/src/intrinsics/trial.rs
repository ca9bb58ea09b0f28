//! A lens on trial: the fit of some of its parameters to corners that another fit used.

use std::cell::OnceCell;

use nalgebra::Isometry3;

use super::adjust::{Adjusted, NEAR, State, Terms};
use super::bundle::{Bundle, Shared};
use super::foretold::{Foretold, Linear};
use super::held_out::{HeldOut, fitted_px};
use super::observations::ObservedView;
use super::prior::Strength;
use crate::reprojection::POSE;
use crate::schur_lm::{SchurNormal, SchurOptions, SchurSolution, solve};

/// Chi-squared of a step of one standard deviation. What the equations foretell of it is off by a hundredth or so.
const ONE: f64 = 1.0;
/// Chi-squared by which the residuals may differ from what the equations foretell where these alone give a fit: less is missing to the optimum.
const LITTLE: f64 = 0.3;
/// Chi-squared of steps for which they tell well enough how far the views scatter.
pub(super) const TEN: f64 = 10.0;

/// A fit to the corners that another one used.
pub(super) struct Trial {
    /// The parameters adjusted.
    pub free: Vec<usize>,
    /// How strongly the prior counts.
    pub prior: Option<Strength>,
    pub state: State,
    pub normal: SchurNormal<POSE>,
    foretold: OnceCell<Option<HeldOut>>,
    fitted_px: OnceCell<f64>,
    rms_px: OnceCell<f64>,
}

/// How much more the views pull the lens to and fro than noise explains; `None` where they do not determine it.
pub(super) fn scatter(normal: &SchurNormal<POSE>) -> Option<f64> {
    normal.scatter(normal.variance()?)
}

/// The fit from `start`. Its last step, of `chi_squared` at most, is made by the equations alone.
fn fitted(problem: &Bundle<'_>, start: State, chi_squared: f64) -> (State, SchurNormal<POSE>) {
    let residuals: usize = problem.views.iter().map(|view| 2 * view.used().count()).sum();
    let options = SchurOptions { relative_cost: (chi_squared / residuals as f64).max(NEAR.relative_cost), ..NEAR };
    let SchurSolution { shared, blocks, normal, .. } = solve(problem, start.shared, start.poses, &options);
    let near = Linear { shared: &shared, poses: &blocks, free: problem.free, normal: &normal };
    let is_small = |foretold: &Foretold| foretold.promised() <= options.relative_cost * normal.cost();
    let Some(foretold) = near.foretold(problem).filter(is_small) else {
        return (State { shared, poses: blocks }, normal);
    };
    let state = foretold.state(problem);
    let normal = foretold.equations(problem, &state);
    (state, normal)
}

/// The fit by the equations alone, with its residuals, and their root mean square in pixels. `None` where they tell something else.
fn foreseen(problem: &Bundle<'_>, foretold: &Foretold) -> Option<(State, SchurNormal<POSE>, f64)> {
    let state = foretold.state(problem);
    let normal = foretold.equations(problem, &state);
    let (mut cost, mut squares, mut count) = (0.0, 0.0, 0);
    for (view, pose) in problem.views.iter().zip(&state.poses) {
        for corner in view.used() {
            let residual = state.shared.residual_px(pose, corner);
            cost += 0.5 * (residual / corner.relative_sigma).powi(2);
            squares += residual * residual;
            count += 1;
        }
    }
    let more = normal.dearer(cost);
    let is_near = 2.0 * more.abs() <= LITTLE * normal.variance()?;
    is_near.then(|| (state, normal.with_more_cost(more), (squares / f64::from(count)).sqrt()))
}

impl Trial {
    /// The fit with `terms` and no others to the corners of `adjusted`, with its prior. Near it `from` was made; `is_same` says that it was made
    /// of the same corners.
    pub fn of(adjusted: &Adjusted, (from, is_same): (&Linear<'_>, bool), terms: Terms) -> Self {
        let (free, prior) = (terms.free(), adjusted.strength);
        let references: Vec<_> = adjusted.views.iter().collect();
        let problem = Bundle { prior, ..Bundle::of(&references, &free) };
        match from.foretold(&problem).filter(|_| is_same) {
            Some(foretold) if foretold.is_at_rest(NEAR.relative_cost) => {
                let Foretold { start, normal, .. } = foretold;
                Self::made(free, prior, (start, normal))
            }
            foretold => match foretold.and_then(|foretold| foreseen(&problem, &foretold)) {
                Some((state, normal, rms_px)) => {
                    Self { rms_px: OnceCell::from(rms_px), ..Self::made(free, prior, (state, normal)) }
                }
                None => Self::fitted(adjusted, from, (terms, prior), ONE),
            },
        }
    }

    /// The same with another prior, fitted to where the optimum is as near as `chi_squared` says.
    pub fn fitted(
        adjusted: &Adjusted,
        from: &Linear<'_>,
        (terms, prior): (Terms, Option<Strength>),
        chi_squared: f64,
    ) -> Self {
        let free = terms.free();
        let references: Vec<_> = adjusted.views.iter().collect();
        let problem = Bundle { prior, ..Bundle::of(&references, &free) };
        let near = from.foretold(&problem).map(|foretold| fitted(&problem, foretold.state(&problem), chi_squared));
        let fit = near
            .filter(|(_, normal)| normal.cost().is_finite())
            .unwrap_or_else(|| fitted(&problem, adjusted.state().with_only(&free), chi_squared));
        Self::made(free, prior, fit)
    }

    fn made(free: Vec<usize>, prior: Option<Strength>, (state, normal): (State, SchurNormal<POSE>)) -> Self {
        let (foretold, fitted_px, rms_px) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Self { free, prior, state, normal, foretold, fitted_px, rms_px }
    }

    /// Its equations.
    pub fn linear(&self) -> Linear<'_> {
        Linear { shared: &self.state.shared, poses: &self.state.poses, free: &self.free, normal: &self.normal }
    }

    /// Standard deviation of a parameter where the variance of a residual is `variance`.
    pub fn sigma(&self, parameter: usize, variance: f64) -> Option<f64> {
        let index = self.free.iter().position(|&free| free == parameter)?;
        let sigma = (self.normal.shared_covariance()?[(index, index)] * variance).sqrt();
        Some(sigma).filter(|sigma| sigma.is_finite())
    }

    /// Root mean square residual in pixels over the corners that `of` used.
    pub fn rms_px(&self, of: &Adjusted) -> f64 {
        *self.rms_px.get_or_init(|| rms_px(&of.views, &self.state.shared, &self.state.poses))
    }

    /// As [`HeldOut::foretold`] for the corners of `of`, that of [`Self::of`].
    pub fn foretold(&self, of: &Adjusted) -> Option<HeldOut> {
        *self.foretold.get_or_init(|| HeldOut::foretold(self, of))
    }

    /// As [`fitted_px`] for the corners of `of`, that of [`Self::of`].
    pub fn fitted_px(&self, of: &Adjusted) -> f64 {
        *self.fitted_px.get_or_init(|| fitted_px(self, of))
    }
}

/// The residuals in pixels of views of `adjusted` that are held out: by one lens, and by another.
pub(super) fn held_out_px(adjusted: &Adjusted, one: &Trial, other: &Trial) -> [f64; 2] {
    match [one, other].map(|lens| lens.foretold(adjusted)) {
        [Some(one), Some(other)] if one.is_told_from(&other) => [one.px, other.px],
        _ => [one, other].map(|lens| lens.fitted_px(adjusted)),
    }
}

fn rms_px(views: &[ObservedView], shared: &Shared, poses: &[Isometry3<f64>]) -> f64 {
    let of_view = |(view, pose): (&ObservedView, &Isometry3<f64>)| {
        view.used().map(|corner| shared.residual_px(pose, corner).powi(2)).sum::<f64>()
    };
    let squares: f64 = views.iter().zip(poses).map(of_view).sum();
    (squares / views.iter().map(|view| view.used().count()).sum::<usize>() as f64).sqrt()
}
