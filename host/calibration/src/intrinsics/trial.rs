//! A richer lens on trial: by how much it fits the corners better that a simpler one used.

use super::adjust::{Adjusted, PupilPrior, State, inlier_fit};
use super::bundle::{Bundle, Shared};
use super::observations::ObservedView;
use super::{IntrinsicsError, IntrinsicsOptions};
use crate::reprojection::POSE;
use crate::schur_lm::{SchurNormal, SchurOptions, solve};

/// Chi-squared by which a richer lens must fit better: of one unknown 5.5 standard deviations; of six unknowns chance gives it once in
/// 25,000 calibrations.
pub(super) const LEAST_GAIN: f64 = 30.0;

/// A fit of more parameters to the corners that a simpler lens used.
pub(super) struct Trial {
    /// The parameters adjusted.
    free: Vec<usize>,
    state: State,
    normal: SchurNormal<POSE>,
    /// By how much the sum of squares falls, in units of the variance of a residual that this lens leaves.
    fall: f64,
    variance: f64,
    prior_factor: f64,
}

/// How much more the views pull the lens to and fro than noise explains; `None` where they do not determine it.
pub(super) fn scatter(normal: &SchurNormal<POSE>, prior_factor: f64) -> Option<f64> {
    let variance = normal.variance()?;
    Some(normal.clustered_with_priors(variance, variance * prior_factor)?.scatter)
}

impl Trial {
    /// `prior` is that of e0.
    pub fn of(simpler: &Adjusted, free: Vec<usize>, prior: Option<PupilPrior>) -> Option<Self> {
        let references: Vec<_> = simpler.views.iter().collect();
        let start = simpler.state();
        let pupil_pull = prior.and_then(|prior| prior.pull(&simpler.views, &start));
        let problem = Bundle { pupil_pull, ..Bundle::of(&references, &free) };
        let solution = solve(&problem, start.shared, start.poses, &SchurOptions::default());
        let variance = solution.normal.variance()?;
        let fall = 2.0 * (simpler.normal.cost() - solution.cost) / variance;
        let state = State { shared: solution.shared, poses: solution.blocks };
        let prior_factor = prior.map_or(1.0, |prior| prior.scatter * prior.scatter);
        fall.is_finite().then_some(Self { free, state, normal: solution.normal, fall, variance, prior_factor })
    }

    /// How much more the views pull this lens to and fro than noise explains.
    pub fn scatter(&self) -> Option<f64> {
        scatter(&self.normal, self.prior_factor)
    }

    /// By how much chi-squared falls where views scatter by `scatter` times what noise explains.
    pub fn gain(&self, scatter: f64) -> f64 {
        self.fall / (scatter * scatter)
    }

    /// Standard deviation of a parameter where views scatter so.
    pub fn sigma(&self, parameter: usize, scatter: f64) -> Option<f64> {
        let index = self.free.iter().position(|&free| free == parameter)?;
        let sigma = (self.normal.shared_covariance()?[(index, index)] * self.variance).sqrt() * scatter;
        Some(sigma).filter(|sigma| sigma.is_finite())
    }

    /// Root mean square residuals in pixels over the corners that `simpler` used: by its lens, and by this one.
    pub fn rms_px(&self, simpler: &Adjusted) -> [f64; 2] {
        let rms = |shared: &Shared, poses: &[nalgebra::Isometry3<f64>]| {
            let of_view = |(view, pose): (&ObservedView, &nalgebra::Isometry3<f64>)| {
                view.used().map(|corner| shared.residual_px(pose, corner).powi(2)).sum::<f64>()
            };
            let squares: f64 = simpler.views.iter().zip(poses).map(of_view).sum();
            (squares / simpler.views.iter().map(|view| view.used().count()).sum::<usize>() as f64).sqrt()
        };
        [rms(&simpler.shared, &simpler.poses), rms(&self.state.shared, &self.state.poses)]
    }

    /// Root mean square residuals in pixels of each half of the views, by the lens that the other half gives: by the simpler lens, and by
    /// this one. The poses of the targets are fitted to the half that is judged.
    pub fn held_out(&self, simpler: &Adjusted) -> [f64; 2] {
        let half = |odd: usize| {
            let chosen =
                simpler.views.iter().zip(&simpler.poses).enumerate().filter(move |(index, _)| index % 2 == odd);
            chosen.map(|(_, (view, pose))| (view, *pose)).unzip::<_, _, Vec<_>, Vec<_>>()
        };
        let halves = [half(0), half(1)];
        let of = |(free, start): (&[usize], Shared)| {
            let (mut squares, mut count) = (0.0, 0);
            for (fitted, judged) in [(0, 1), (1, 0)] {
                let [(views, poses), (others, other_poses)] = [&halves[fitted], &halves[judged]];
                let lens = solve(&Bundle::of(views, free), start, poses.clone(), &SchurOptions::default()).shared;
                let seen = solve(&Bundle::of(others, &[]), lens, other_poses.clone(), &SchurOptions::default());
                squares += 2.0 * seen.cost;
                count += others.iter().map(|view| view.used().count()).sum::<usize>();
            }
            (squares / count as f64).sqrt()
        };
        [(simpler.free.as_slice(), simpler.shared), (self.free.as_slice(), self.state.shared)].map(of)
    }

    /// The adjustment with this lens, in which corners may count that the simpler lens left out.
    ///
    /// # Errors
    /// Those of [`inlier_fit`].
    pub fn kept(
        self,
        simpler: Adjusted,
        prior: Option<PupilPrior>,
        options: &IntrinsicsOptions,
    ) -> Result<Adjusted, IntrinsicsError> {
        let adjusted = inlier_fit(simpler.views, self.state, self.free, prior, options)?;
        // Views that the simpler fit dropped stay dropped.
        let outliers = simpler.outliers.into_iter().chain(adjusted.outliers).collect();
        Ok(Adjusted { outliers, ..adjusted })
    }
}
