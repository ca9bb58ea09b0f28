//! The joint least-squares problem: target poses, lenses, and the unknowns of the relative pose.

use nalgebra::{Isometry3, Matrix6xX, SVector};

use crate::TargetShape;
use crate::extrinsics::Side;
use crate::extrinsics::StereoView;
use crate::extrinsics::stereo::{LensPrior, Lenses, Pair};
use crate::reprojection::{POSE, moved};
use crate::schur_lm::{Equations, SchurProblem};

/// Model of the relative pose: one pose for all views, or the axes of a stage.
pub(crate) trait Kinematics: Sync {
    /// The unknowns.
    type State: Clone + Send + Sync;

    /// Components of a step.
    fn dimension(&self) -> usize;

    /// `state` moved by `step`.
    fn plus(&self, state: &Self::State, step: &[f64]) -> Self::State;

    /// `left_from_right` at view `view`.
    fn left_from_right(&self, state: &Self::State, view: usize) -> Isometry3<f64>;

    /// The move of `left_from_right` at view `view` by the components of a step.
    fn derivative(&self, state: &Self::State, view: usize) -> Matrix6xX<f64>;

    /// Adds what is known of `state` besides the views, in units of `sigma`, the standard deviation of a
    /// pixel coordinate in those of the corner's relative sigma.
    fn add_prior(&self, _state: &Self::State, _sigma: f64, _equations: &mut Equations<POSE>) {}
}

/// One relative pose for all views.
pub(crate) struct FixedPose;

impl Kinematics for FixedPose {
    type State = Isometry3<f64>;

    fn dimension(&self) -> usize {
        POSE
    }

    fn plus(&self, pose: &Isometry3<f64>, step: &[f64]) -> Isometry3<f64> {
        step.get(..POSE).map_or(*pose, |part| moved(pose, &SVector::<f64, POSE>::from_column_slice(part)))
    }

    fn left_from_right(&self, pose: &Isometry3<f64>, _: usize) -> Isometry3<f64> {
        *pose
    }

    fn derivative(&self, _: &Isometry3<f64>, _: usize) -> Matrix6xX<f64> {
        Matrix6xX::identity(POSE)
    }
}

/// Number of heights of a bow.
pub(crate) const BOW: usize = 2;

/// The shared unknowns: the kinematics' components of a step come first, then the lenses', then the heights of the target's bow.
#[derive(Clone, Debug)]
pub(crate) struct Shared<S> {
    pub state: S,
    pub lenses: Lenses,
    pub shape: TargetShape,
}

/// The least-squares problem over the views in `kept`.
pub(crate) struct Joint<'a, K: Kinematics> {
    pub kinematics: &'a K,
    pub lens_prior: LensPrior,
    /// Whether the bow of the target is unknown.
    pub bows: bool,
    pub sigma: f64,
    pub views: &'a [StereoView],
    /// Indices of the views that have a block.
    pub kept: &'a [usize],
    /// Whether each corner of each view counts, in the order of [`StereoView::corners`].
    pub used: &'a [Vec<bool>],
}

impl<K: Kinematics> SchurProblem<POSE> for Joint<'_, K> {
    type Shared = Shared<K::State>;
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        self.kinematics.dimension() + self.lens_prior.dimension() + if self.bows { BOW } else { 0 }
    }

    fn block_residuals(
        &self,
        shared: &Self::Shared,
        index: usize,
        left_from_target: &Isometry3<f64>,
        equations: &mut Equations<POSE>,
    ) {
        let Some((view, corners, used)) =
            self.kept.get(index).and_then(|&view| Some((view, self.views.get(view)?, self.used.get(view)?)))
        else {
            return;
        };
        let pair = Pair {
            left_from_right: self.kinematics.left_from_right(&shared.state, view),
            lenses: shared.lenses,
            shape: shared.shape,
        };
        let by_step = self.kinematics.derivative(&shared.state, view);
        let lens_column = by_step.ncols();
        let mut columns = vec![[0.0; 2]; self.shared_dimension()];
        for ((side, corner), _) in corners.corners().zip(used).filter(|(_, used)| **used) {
            let Some(residual) = pair.residual(side, corner, left_from_target) else {
                // An infinite cost refuses the step that led here.
                equations.add(&[f64::INFINITY; 2], 1.0, &[], &[[0.0; 2]; POSE]);
                continue;
            };
            columns.fill([0.0; 2]);
            if side == Side::Right {
                let by_state = residual.by_relative_pose * &by_step;
                columns.iter_mut().zip(by_state.column_iter()).for_each(|(slot, c)| *slot = [c[0], c[1]]);
            }
            let [left, right] = &self.lens_prior.unknown;
            let (own, unknown) =
                if side == Side::Left { (lens_column, left) } else { (lens_column + left.len(), right) };
            for (slot, &parameter) in columns.iter_mut().skip(own).zip(unknown) {
                *slot = residual.by_lens.column(parameter).into_owned().into();
            }
            if self.bows {
                let first = columns.len() - BOW;
                let heights = shared.shape.bow(corner.target_mm);
                columns[first..].copy_from_slice(&heights.map(|height| (residual.by_height * height).into()));
            }
            equations.add(&residual.error.into(), corner.relative_sigma, &columns, &residual.by_target.into());
        }
    }

    fn shared_residuals(&self, shared: &Self::Shared, equations: &mut Equations<POSE>) {
        self.kinematics.add_prior(&shared.state, self.sigma, equations);
        self.lens_prior.add_to(&shared.lenses, self.kinematics.dimension(), equations);
    }

    fn shared_plus(&self, shared: &Self::Shared, step: &[f64]) -> Self::Shared {
        let (state, others) = step.split_at(self.kinematics.dimension().min(step.len()));
        let (lenses, heights) = others.split_at(self.lens_prior.dimension().min(others.len()));
        let [x, y] = shared.shape.heights_mm();
        let shape = match heights {
            [by_x, by_y] => shared.shape.bent([x + by_x, y + by_y]),
            _ => shared.shape,
        };
        Shared {
            shape,
            state: self.kinematics.plus(&shared.state, state),
            lenses: self.lens_prior.moved(&shared.lenses, lenses),
        }
    }

    fn block_plus(&self, pose: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(pose, step)
    }
}
