//! Whether the target bows, as the views of both cameras tell.
//!
//! A bow that is taken for a plane turns and shifts the targets as each camera sees them, and with them the pair. As of a lens
//! ([`crate::LensStep::TargetBow`]) the fit is made with and without the bow, which is kept where chi-squared falls by more than noise and the
//! scatter of the views explain, and views that were held out do not get worse.

use nalgebra::{DMatrix, Isometry3, SVector};

use crate::extrinsics::fit::{Fit, Start, Task};
use crate::extrinsics::joint::{BOW, Joint, Kinematics, Shared};
use crate::intrinsics::LEAST_GAIN;
use crate::reprojection::{POSE, moved};
use crate::schur_lm::{self, Equations, SchurOptions, SchurProblem, SchurSolution};
use crate::{TargetShape, TargetWarp};

impl<K: Kinematics> Task<'_, K> {
    /// Where a fit with a bow starts; `None` where the views show none.
    pub(super) fn bowed(&self, flat: &Fit<K::State>, usable: &[Vec<bool>]) -> Option<Start<K::State>> {
        let kept: Vec<usize> = (0..self.views.len()).filter(|&view| flat.inliers[view].contains(&true)).collect();
        let corners = self.views.iter().flat_map(|view| view.corners().map(|(_, corner)| corner));
        let shape = TargetShape::over(corners);
        let start = Shared { shape, ..flat.shared.clone() };
        let [without, with] = [false, true].map(|bows| self.solved(flat, &start, &kept, bows));
        let (without, with) = (without?, with?);
        let variance = with.normal.variance()? * with.normal.clustered(flat.sigma * flat.sigma)?.scatter.powi(2);
        if 2.0 * (without.cost - with.cost) <= LEAST_GAIN * variance {
            return None;
        }
        let [odd, even] = [1, 0].map(|odd| kept.iter().copied().filter(|view| view % 2 == odd).collect::<Vec<_>>());
        let held_out = |bows| {
            let [first, second] = [(&odd, &even), (&even, &odd)]
                .map(|(fitted, judged)| self.predicted(flat, &start, fitted, judged, bows));
            Some(first? + second?)
        };
        if held_out(true)? > held_out(false)? {
            return None;
        }
        let mut targets = flat.targets.clone();
        kept.iter().zip(&with.blocks).for_each(|(&view, target)| targets[view] = *target);
        Some(Start { shared: with.shared, targets, usable: usable.to_vec() })
    }

    /// The fit to the corners that `flat` used in these views.
    fn solved(
        &self,
        flat: &Fit<K::State>,
        start: &Shared<K::State>,
        views: &[usize],
        bows: bool,
    ) -> Option<SchurSolution<Shared<K::State>, Isometry3<f64>, POSE>> {
        let problem = Joint { bows, ..self.problem(self.knowledge, flat.sigma, views, &flat.inliers).ok()? };
        let targets = views.iter().map(|&view| flat.targets[view]).collect();
        let solution = schur_lm::solve(&problem, start.clone(), targets, &SchurOptions::default());
        solution.cost.is_finite().then_some(solution)
    }

    /// The cost of the `judged` views by the fit to others, only the poses of the target fitted to them.
    fn predicted(
        &self,
        flat: &Fit<K::State>,
        start: &Shared<K::State>,
        fitted: &[usize],
        judged: &[usize],
        bows: bool,
    ) -> Option<f64> {
        let shared = self.solved(flat, start, fitted, bows)?.shared;
        let problem = self.problem(self.knowledge, flat.sigma, judged, &flat.inliers).ok()?;
        let targets = judged.iter().map(|&view| flat.targets[view]).collect();
        let cost =
            schur_lm::solve(&Fixed { problem: &problem, shared: &shared }, (), targets, &SchurOptions::default()).cost;
        cost.is_finite().then_some(cost)
    }
}

/// The problem of the targets' poses alone.
struct Fixed<'a, K: Kinematics> {
    problem: &'a Joint<'a, K>,
    shared: &'a Shared<K::State>,
}

impl<K: Kinematics> SchurProblem<POSE> for Fixed<'_, K> {
    type Shared = ();
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        0
    }

    fn block_residuals(&self, (): &(), index: usize, target: &Isometry3<f64>, equations: &mut Equations<POSE>) {
        self.problem.block_residuals(self.shared, index, target, equations);
    }

    fn shared_plus(&self, (): &(), _: &[f64]) {}

    fn block_plus(&self, pose: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(pose, step)
    }
}

/// The bow in the last rows of this covariance.
pub(super) fn warp_of(shape: TargetShape, covariance: &DMatrix<f64>) -> TargetWarp {
    let last = covariance.nrows() - BOW;
    TargetWarp { shape, sigma_mm: [0, 1].map(|height| covariance[(last + height, last + height)].sqrt()) }
}

/// The part of the first unknowns.
pub(super) fn first(matrix: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    matrix.view((0, 0), (count, count)).into_owned()
}

/// The information of the first unknowns where the last ones are unknown too; `None` where it says nothing of these.
pub(super) fn marginal(information: &DMatrix<f64>, count: usize) -> Option<DMatrix<f64>> {
    let others = information.nrows() - count;
    if others == 0 {
        return Some(information.clone());
    }
    let coupling = information.view((0, count), (count, others)).into_owned();
    let rest = information.view((count, count), (others, others)).into_owned().cholesky()?;
    Some(first(information, count) - &coupling * rest.solve(&coupling.transpose()))
}
