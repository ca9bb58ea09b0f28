//! Starting values of the joint fit of a stage: every stage pose calibrated alone, and the chains fitted to those.

use nalgebra::{Isometry3, Matrix6, SVector};
use vergence_rig::{AxisPosition, Link, Rig, RigAxis, Screw};
use vergence_vision::{Frame, Transform};

use crate::TargetShape;
use crate::extrinsics::{
    ExtrinsicsCalibration, ExtrinsicsOptions, Kinematics, LensKnowledge, Lenses, OwnPoses, PlacedView, Shared, Side,
    StereoView, calibrate_extrinsics, inside, nearer_targets, place,
};
use crate::reprojection::{POSE, difference};
use crate::schur_lm::{self, Equations, SchurOptions, SchurProblem};
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::unknowns::Unknown;
use crate::stage::{StageError, StageOptions, StagePose};

/// Model of `rig` without views.
pub(crate) fn model(rig: &Rig, poses: &[StagePose], options: &StageOptions) -> Result<Model, StageError> {
    let axes = &rig.axes;
    check_readings(rig, poses)?;
    let reading_sigma: Vec<f64> = if options.reading_sigma.is_empty() {
        // Standard deviation of a uniform error of one encoder step, and of the play that is known.
        axes.iter().map(|axis| axis.sigma_with_play(1.0 / 12f64.sqrt()) * axis.value_per_count()).collect()
    } else if belong(axes, &options.reading_sigma) {
        options.reading_sigma.iter().map(|sigma| sigma.value()).collect()
    } else {
        return Err(StageError::ReadingSigma);
    };
    if !reading_sigma.iter().all(|&sigma| sigma > 0.0) {
        return Err(StageError::ReadingSigma);
    }
    let nominal = State {
        left: rig.left_chain.links().to_vec(),
        left_at_zero: *rig.left_chain.at_zero().isometry(),
        right: rig.right_chain.links().to_vec(),
        right_at_zero: *rig.right_chain.at_zero().isometry(),
        scales: vec![1.0; axes.len()],
        reading_errors: vec![vec![0.0; axes.len()]; poses.len()],
        returns: Vec::new(),
    };
    // While the stage poses are fitted as such, the views of the mechanism are they.
    let pose_of_view = (0..poses.len()).collect();
    Ok(Model {
        unknowns: unknowns(&nominal, axes.len(), poses.len(), options.free_scales),
        nominal,
        readings: poses.iter().map(|pose| pose.readings.iter().map(|reading| reading.value()).collect()).collect(),
        reading_sigma,
        return_sigma: None,
        pose_of_view,
        tolerance: options.tolerance,
    })
}

/// Whether there is one finite position for each axis, of its kind.
fn belong(axes: &[RigAxis], positions: &[AxisPosition]) -> bool {
    let fits = |(position, axis): (&AxisPosition, &RigAxis)| position.is_of(axis.kind) && position.value().is_finite();
    positions.len() == axes.len() && positions.iter().zip(axes).all(fits)
}

/// Refuses stage poses whose readings are not those of the rig's axes.
pub(crate) fn check_readings(rig: &Rig, poses: &[StagePose]) -> Result<(), StageError> {
    match poses.iter().position(|pose| !belong(&rig.axes, &pose.readings)) {
        Some(pose) => Err(StageError::Readings { pose: pose + 1 }),
        None => Ok(()),
    }
}

fn unknowns(state: &State, axes: usize, poses: usize, free_scales: bool) -> Vec<Unknown> {
    let mut unknowns = Vec::new();
    for (side, links) in [(Side::Left, &state.left), (Side::Right, &state.right)] {
        for (link, Link { axis, screw, .. }) in links.iter().enumerate() {
            unknowns.extend([Unknown::Direction { side, link, axis: *axis }; 2]);
            if matches!(screw, Screw::Turn { .. }) {
                unknowns.extend([Unknown::Line { side, link, axis: *axis }; 2]);
            }
        }
    }
    unknowns.extend([Unknown::Rotation; 3]);
    unknowns.extend([Unknown::Position; 3]);
    let driven = |axis: &usize| state.left.iter().chain(&state.right).any(|link| link.axis == *axis);
    if free_scales {
        unknowns.extend((0..axes).filter(driven).map(|axis| Unknown::Scale { axis }));
    }
    unknowns.extend((0..poses).flat_map(|pose| {
        (0..axes).filter(driven).map(move |axis| Unknown::Reading { pose, axis }).collect::<Vec<_>>()
    }));
    unknowns
}

/// Each stage pose calibrated by itself, the lenses held.
pub(crate) fn poses_alone(
    rig: &Rig,
    poses: &[StagePose],
    robust: bool,
) -> Result<Vec<ExtrinsicsCalibration>, StageError> {
    let options = ExtrinsicsOptions { lenses: LensKnowledge::Exact, robust };
    let calibrate = |(index, pose): (usize, &StagePose)| {
        calibrate_extrinsics(&rig.left_camera, &rig.right_camera, &pose.views, &options)
            .map_err(|reason| StageError::Pose { pose: index + 1, reason })
    };
    poses.iter().enumerate().map(calibrate).collect()
}

/// The chains that fit the stage poses best. `None` if the iteration does not converge.
pub(crate) fn fitted_to_poses(model: &Model, alone: &[ExtrinsicsCalibration]) -> Option<State> {
    let measured = measured(alone)?;
    // The right camera at zero that makes the first stage pose right, the rest as drawn.
    let first = model.readings.first()?;
    let drawn = model.nominal.left_from_right(first);
    let at_zero = model.nominal.right_at_zero * (drawn.inverse() * measured.first()?.0);
    let start = State { right_at_zero: at_zero, ..model.nominal.clone() };
    let problem = ToPoses { kinematics: model, measured: &measured };
    let solution = schur_lm::solve(&problem, start, Vec::new(), &SchurOptions::default());
    solution.cost.is_finite().then_some(solution.shared)
}

/// `left_from_right` of a stage pose, and what makes the errors of its local coordinates independent and of unit variance.
pub(crate) type Measured = (Isometry3<f64>, Matrix6<f64>);

/// The stage poses as each was calibrated by itself. `None` where a covariance is singular.
pub(crate) fn measured(alone: &[ExtrinsicsCalibration]) -> Option<Vec<Measured>> {
    let whitened = |pose: &ExtrinsicsCalibration| {
        let whitening = pose.noise_covariance.cholesky()?.l().try_inverse()?;
        Some((*pose.joint.left_from_right.isometry(), whitening))
    };
    alone.iter().map(whitened).collect()
}

/// A mechanism against the stage poses as each was calibrated by itself: the views of `kinematics` are stage poses here.
pub(crate) struct ToPoses<'a, K: Kinematics> {
    pub kinematics: &'a K,
    pub measured: &'a [Measured],
}

impl<K: Kinematics> SchurProblem<POSE> for ToPoses<'_, K> {
    type Shared = K::State;
    type Block = ();

    fn shared_dimension(&self) -> usize {
        self.kinematics.dimension()
    }

    fn block_residuals(&self, _: &K::State, _: usize, (): &(), _: &mut Equations<POSE>) {}

    fn shared_residuals(&self, state: &K::State, equations: &mut Equations<POSE>) {
        for (pose, (measured, whitening)) in self.measured.iter().enumerate() {
            let residual = whitening * difference(&self.kinematics.left_from_right(state, pose), measured);
            let derivative = whitening * self.kinematics.derivative(state, pose);
            let columns: Vec<[f64; POSE]> = derivative.column_iter().map(|c| c.into_owned().into()).collect();
            equations.add_plain(&residual.into(), &columns, &[[0.0; POSE]; POSE]);
        }
        self.kinematics.add_prior(state, 1.0, equations);
    }

    fn shared_plus(&self, state: &K::State, step: &[f64]) -> K::State {
        self.kinematics.plus(state, step)
    }

    fn block_plus(&self, (): &(), _: &SVector<f64, POSE>) {}
}

/// All views in one list, placed.
pub(crate) struct Prepared<S> {
    pub views: Vec<StereoView>,
    pub pose_of_view: Vec<usize>,
    pub own_poses: Vec<OwnPoses>,
    pub usable: Vec<Vec<bool>>,
    pub targets: Vec<Isometry3<f64>>,
    pub shared: Shared<S>,
}

/// The views of all stage poses; `left_from_right` gives the relative pose at a stage pose by its index, in `state`.
pub(crate) fn prepare<S>(
    rig: &Rig,
    state: S,
    poses: &[StagePose],
    left_from_right: impl Fn(&S, usize) -> Isometry3<f64>,
) -> Result<Prepared<S>, StageError> {
    let (left, right) = (&rig.left_camera, &rig.right_camera);
    let lenses = Lenses::of(left, right);
    let mut all = Prepared {
        views: Vec::new(),
        pose_of_view: Vec::new(),
        own_poses: Vec::new(),
        usable: Vec::new(),
        targets: Vec::new(),
        shared: Shared { state, lenses, shape: TargetShape::FLAT },
    };
    for (index, pose) in poses.iter().enumerate() {
        let (placed, _) =
            place(left, right, &pose.views).map_err(|reason| StageError::Pose { pose: index + 1, reason })?;
        let left_from_right = left_from_right(&all.shared.state, index);
        all.targets.extend(nearer_targets(lenses, &left_from_right, &pose.views, &placed));
        all.own_poses.extend(placed.iter().map(PlacedView::own_poses));
        for view in placed.iter().filter_map(|place| pose.views.get(place.view)) {
            all.usable.push(inside(left, right, view));
            all.views.push(view.clone());
            all.pose_of_view.push(index);
        }
    }
    Ok(all)
}

/// A pose with its frames named.
pub(crate) fn named<To: Frame, From: Frame>(pose: &Isometry3<f64>) -> Transform<To, From> {
    Transform::from_isometry(*pose)
}
