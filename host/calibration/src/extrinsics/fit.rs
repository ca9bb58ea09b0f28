//! The joint fit: a robust loss to get near, then outliers are removed and plain least squares gives result and
//! covariance.

use nalgebra::{DMatrix, Isometry3};
use vergence_rig::RigNumber;

use crate::extrinsics::StereoView;
use crate::extrinsics::bow::{first, marginal, warp_of};
use crate::extrinsics::joint::{BOW, Joint, Kinematics, Shared};
use crate::extrinsics::outliers::{OwnPoses, inliers, median_of};
use crate::extrinsics::report::rms;
use crate::extrinsics::stereo::{LensKnowledge, LensPrior, Lenses, Pair};
use crate::schur_lm::{self, Clustered, SchurOptions, SchurProblem};
use crate::{Loss, TargetWarp};

/// The median length of a two-dimensional Gaussian error of unit standard deviation per coordinate: √(2 ln 2).
const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_474_7;
/// Smallest standard deviation of a corner, in relative sigmas; simulated corners may fit perfectly.
const FINEST: f64 = 1e-3;
/// Most rounds of fit and outlier removal; two or three usually suffice.
const MOST_ROUNDS: usize = 10;

/// Starting values of the fit.
pub(crate) struct Start<S> {
    pub shared: Shared<S>,
    /// `left_from_target` of every view.
    pub targets: Vec<Isometry3<f64>>,
    /// Whether each corner may be used, in the order of [`StereoView::corners`].
    pub usable: Vec<Vec<bool>>,
}

/// The result of a fit.
pub(crate) struct Fit<S> {
    pub shared: Shared<S>,
    /// `left_from_target` of every view; the last value for a view without inliers.
    pub targets: Vec<Isometry3<f64>>,
    /// Whether each corner is an inlier.
    pub inliers: Vec<Vec<bool>>,
    /// Distance of each corner from its reprojection.
    pub errors_px: Vec<Vec<f64>>,
    /// Bow of the target, where the views show one.
    pub warp: Option<TargetWarp>,
    /// Standard deviation of a pixel coordinate in units of the corner's relative sigma.
    pub sigma: f64,
    /// The same, by which what is known besides the corners was weighted.
    pub sigma_of_priors: f64,
    /// Covariance of the shared unknowns' step as the views scatter; `None` if the corners do not determine it.
    pub covariance: Option<Clustered>,
    /// The same by independent noise of the corners alone.
    pub noise_covariance: Option<DMatrix<f64>>,
    /// The lens parameters among the shared unknowns; they come last.
    pub lens_numbers: Vec<RigNumber>,
    /// Information of the shared unknowns, in units of `sigma`².
    pub information: DMatrix<f64>,
}

impl<S> Fit<S> {
    /// Standard deviation of a pixel coordinate in pixels, root mean square over the inliers of `views`.
    pub fn sigma_px(&self, views: &[StereoView]) -> f64 {
        let sigmas = |view: &StereoView| view.corners().map(|(_, corner)| corner.relative_sigma).collect();
        let sigmas: Vec<Vec<f64>> = views.iter().map(sigmas).collect();
        self.sigma * rms(&sigmas, &self.inliers).unwrap_or(1.0)
    }
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoFit {
    /// The corners do not determine an unknown.
    NotDetermined,
    /// The iteration did not reach an optimum.
    Diverged,
    /// A lens's covariance is not positive definite.
    NotACovariance,
}

/// A fitting task: kinematics, views and what is known of the lenses.
pub(crate) struct Task<'a, K: Kinematics> {
    pub kinematics: &'a K,
    pub views: &'a [StereoView],
    /// Poses of the target in each view, one entry for a view.
    pub own_poses: &'a [OwnPoses],
    /// Lenses as their own calibration found them.
    pub lenses: Lenses,
    pub knowledge: &'a LensKnowledge,
    /// Whether outliers are left out.
    pub robust: bool,
}

impl<K: Kinematics> Task<'_, K> {
    /// The optimum near `start`: of a flat target, or of one that bows where the views show that it does.
    pub fn fit(&self, start: Start<K::State>) -> Result<Fit<K::State>, NoFit> {
        let usable = start.usable.clone();
        let flat = self.fit_shape(start, false)?;
        match self.bowed(&flat, &usable) {
            Some(start) => self.fit_shape(start, true),
            None => Ok(flat),
        }
    }

    /// The optimum near `start`, where `bows` says whether the bow of the target is unknown.
    fn fit_shape(&self, start: Start<K::State>, bows: bool) -> Result<Fit<K::State>, NoFit> {
        let Start { mut shared, mut targets, usable } = start;
        if *self.knowledge != LensKnowledge::Exact {
            shared.lenses = shared.lenses.polynomial();
        }
        let mut sigma = self.settle(&mut shared, &mut targets, &usable)?;
        let mut inliers = self.inliers(&shared, &self.errors_px(&shared, &targets), &usable);
        let mut round = 0;
        loop {
            round += 1;
            let kept: Vec<usize> = (0..inliers.len()).filter(|&view| inliers[view].contains(&true)).collect();
            let problem = Joint { bows, ..self.problem(self.knowledge, sigma, &kept, &inliers)? };
            let kept_targets = kept.iter().map(|&view| targets[view]).collect();
            let solution = schur_lm::solve(&problem, shared, kept_targets, &SchurOptions::default());
            if !solution.cost.is_finite() {
                return Err(NoFit::Diverged);
            }
            shared = solution.shared;
            kept.iter().zip(&solution.blocks).for_each(|(&view, target)| targets[view] = *target);
            let variance = solution.normal.variance().ok_or(NoFit::NotDetermined)?;
            let errors_px = self.errors_px(&shared, &targets);
            let next = self.inliers(&shared, &errors_px, &usable);
            // Priors are weighted by the corners' standard deviation, so that must settle too.
            let next_sigma = variance.sqrt().max(FINEST);
            let settled = next == inliers && (next_sigma - sigma).abs() <= 1e-3 * sigma;
            let sigma_of_priors = sigma;
            sigma = next_sigma;
            if settled || round == MOST_ROUNDS {
                let information = solution.normal.shared_information().ok_or(NoFit::NotDetermined)?;
                let covariance = solution.normal.clustered(sigma * sigma);
                let noise_covariance = solution.normal.shared_covariance().map(|unit| unit * (sigma * sigma));
                let warp = covariance.as_ref().filter(|_| bows).map(|all| warp_of(shared.shape, &all.covariance));
                let others = problem.shared_dimension() - if bows { BOW } else { 0 };
                let (information, covariance, noise_covariance) = (
                    marginal(&information, others).ok_or(NoFit::NotDetermined)?,
                    covariance.map(|all| Clustered { covariance: first(&all.covariance, others), ..all }),
                    noise_covariance.map(|all| first(&all, others)),
                );
                return Ok(Fit {
                    warp,
                    lens_numbers: problem.lens_prior.numbers(),
                    shared,
                    targets,
                    inliers,
                    errors_px,
                    sigma,
                    sigma_of_priors,
                    covariance,
                    noise_covariance,
                    information,
                });
            }
            inliers = next;
        }
    }

    /// Brings the unknowns near the optimum, first with the lenses held; returns [`Fit::sigma`] estimated by the
    /// median.
    fn settle(
        &self,
        shared: &mut Shared<K::State>,
        targets: &mut Vec<Isometry3<f64>>,
        usable: &[Vec<bool>],
    ) -> Result<f64, NoFit> {
        let every: Vec<usize> = (0..self.views.len()).collect();
        let mut scale = self.median_deviation(shared, targets, usable);
        for knowledge in [&LensKnowledge::Exact, self.knowledge, self.knowledge] {
            let problem = self.problem(knowledge, scale / RAYLEIGH_MEDIAN, &every, usable)?;
            let loss = if self.robust { Loss::Huber(2.0 * scale) } else { Loss::Squares };
            let options = SchurOptions { loss, relative_cost: 1e-5, ..SchurOptions::default() };
            let solution = schur_lm::solve(&problem, shared.clone(), std::mem::take(targets), &options);
            (*shared, *targets) = (solution.shared, solution.blocks);
            scale = self.median_deviation(shared, targets, usable);
        }
        Ok((scale / RAYLEIGH_MEDIAN).max(FINEST))
    }

    pub(super) fn problem<'a>(
        &'a self,
        knowledge: &LensKnowledge,
        sigma: f64,
        kept: &'a [usize],
        used: &'a [Vec<bool>],
    ) -> Result<Joint<'a, K>, NoFit> {
        let lens_prior = LensPrior::new(self.lenses, knowledge, sigma).ok_or(NoFit::NotACovariance)?;
        Ok(Joint { kinematics: self.kinematics, lens_prior, bows: false, sigma, views: self.views, kept, used })
    }

    fn median_deviation(&self, shared: &Shared<K::State>, targets: &[Isometry3<f64>], usable: &[Vec<bool>]) -> f64 {
        let errors_px = self.errors_px(shared, targets);
        let in_sigmas = |(view, errors): (&StereoView, &Vec<f64>)| {
            view.corners().zip(errors).map(|((_, corner), &error)| corner.deviation(error)).collect()
        };
        median_of(&self.views.iter().zip(&errors_px).map(in_sigmas).collect::<Vec<_>>(), usable)
    }

    pub fn errors_px(&self, shared: &Shared<K::State>, targets: &[Isometry3<f64>]) -> Vec<Vec<f64>> {
        let view_errors = |(index, (view, target)): (usize, (&StereoView, &Isometry3<f64>))| {
            let left_from_right = self.kinematics.left_from_right(&shared.state, index);
            Pair { left_from_right, lenses: shared.lenses, shape: shared.shape }.errors_px(view, target)
        };
        self.views.iter().zip(targets).enumerate().map(view_errors).collect()
    }

    fn inliers(&self, shared: &Shared<K::State>, errors_px: &[Vec<f64>], usable: &[Vec<bool>]) -> Vec<Vec<bool>> {
        if self.robust {
            inliers(&shared.lenses, self.views, (self.own_poses, &shared.shape), errors_px, usable)
        } else {
            usable.to_vec()
        }
    }
}
