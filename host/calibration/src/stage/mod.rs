//! The moving stage: screw axes, encoder scales and the cameras' pose at zero, from targets seen at several stage
//! poses.
//!
//! The model is the rig's own screw chain. Each stage pose is calibrated by itself first; then everything is refined
//! jointly on all corners. Afterwards the relative pose is known wherever the axes stand, with its covariance.
//!
//! Readings that are off by more than a step of the encoder show play, or a mechanism that is not one of screws: their standard deviation is
//! estimated, and the file states it as the play of the axis. Cameras that return to a pose turned or shifted beside where the axes put them,
//! differently each time, are freed to do so, and the file states how far as the rig's repeatability.
//!
//! The base frame is held by the left camera with all axes at zero, which stays where the drawing has it; the encoders'
//! zeros are part of the right camera's pose there.

mod covariance;
mod enough_views;
mod figures;
mod mechanism;
mod model;
mod observability;
mod play;
mod result;
pub(crate) mod start;
mod twist;
mod unknowns;

use nalgebra::Isometry3;
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Angle, Length};

use crate::extrinsics::{ExtrinsicsError, Fit, LensKnowledge, Start, StereoView, Task};
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::start::Prepared;

pub use enough_views::with_enough_views;
pub use observability::{Observability, WeakDirection};
pub use result::{EncoderScale, FittedScrew, PredictedPose, StageCalibration, StagePoseFigures, ZeroOffset};

/// Where views scatter by more of their corners' noise, the stage may not return to where its mechanism puts it.
const MOST_SCATTER: f64 = 1.1;
/// How far returns to a stage pose may be off while it is asked how far they are, in radians and millimetres: as far as any stage's.
const FREE_RETURNS: [f64; 2] = [5e-3, 0.5];

/// Least number of stage poses: fewer cannot separate a slide, a turn and the pose at zero.
pub const FEWEST_STAGE_POSES: usize = 3;

/// Views taken while the stage stood still.
#[derive(Clone, Debug, PartialEq)]
pub struct StagePose {
    /// Encoder readings, in the order of the rig's axes.
    pub readings: Vec<AxisPosition>,
    /// Views of the target, a dozen or more.
    pub views: Vec<StereoView>,
}

/// Deviation of a mechanism from its drawing: one standard deviation of each kind of unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Standard deviation of a screw's direction about each of two axes.
    pub direction: Angle,
    /// Standard deviation of the position of a rotation's line along each of two axes.
    pub position: Length,
    /// Standard deviation of an encoder's scale, as a ratio.
    pub scale: f64,
}

impl Default for Tolerance {
    /// Tolerances of a hand-built mechanism: 3°, 10 mm, 1 %.
    fn default() -> Self {
        Self { direction: Angle::from_deg(3.0), position: Length::from_mm(10.0), scale: 0.01 }
    }
}

/// Options of [`calibrate_stage`].
#[derive(Clone, Debug, PartialEq)]
pub struct StageOptions {
    /// Prior knowledge of both lenses.
    pub lenses: LensKnowledge,
    /// Whether outliers are left out.
    pub robust: bool,
    /// Whether the encoders' scales are unknown.
    pub free_scales: bool,
    /// How far the mechanism may be from the rig's chains; `None`: they are only where to start.
    pub tolerance: Option<Tolerance>,
    /// Standard deviation of a reading of each axis. Empty: that of a step of its encoder and of the play that the rig states. It is
    /// estimated where the images ask for more.
    pub reading_sigma: Vec<AxisPosition>,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            lenses: LensKnowledge::Exact,
            robust: true,
            free_scales: true,
            tolerance: Some(Tolerance::default()),
            reading_sigma: Vec::new(),
        }
    }
}

/// Why there is no calibration of the stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// The rig's cameras ride on a trunk, which has no screws to fit.
    #[error("rig '{0}' has a trunk and no screws: calibrate its links and mounts instead")]
    Trunk(String),
    /// The rig has no trunk.
    #[error("rig '{0}' has no trunk: calibrate its screws instead")]
    NoTrunk(String),
    /// Fewer stage poses than three.
    #[error("{0} stage poses; at least {FEWEST_STAGE_POSES} are needed, and 6 are better")]
    TooFewPoses(usize),
    /// A stage pose whose readings do not belong to the rig's axes, or a standard deviation that is none.
    #[error("stage pose {pose}: the readings do not belong to the rig's axes")]
    Readings {
        /// Counted from 1.
        pose: usize,
    },
    /// The standard deviations of the readings do not belong to the rig's axes or are not positive.
    #[error("the standard deviations of the readings must be one per axis, of its kind and positive")]
    ReadingSigma,
    /// A stage pose that cannot be calibrated by itself.
    #[error("stage pose {pose}: {reason}")]
    Pose {
        /// Counted from 1.
        pose: usize,
        /// Why not.
        reason: ExtrinsicsError,
    },
    /// No mechanism near the rig's chains has these poses.
    #[error("the stage poses do not fit the rig's chains: check the order of the axes and the signs of their shares")]
    Diverged,
    /// The joint fit failed.
    #[error(transparent)]
    Joint(ExtrinsicsError),
    /// The stage poses do not determine an unknown.
    #[error("the stage poses leave the mechanism open: {0}")]
    Unobservable(Observability),
}

/// Calibrates the chains of `rig` on targets seen at `poses`. The rig's cameras and chains are where it starts.
///
/// # Errors [`StageError`] if stage poses are too few, cannot be calibrated, do not fit the chains or do not determine
/// them.
pub fn calibrate_stage(rig: &Rig, poses: &[StagePose], options: &StageOptions) -> Result<StageCalibration, StageError> {
    if rig.trunk.is_some() {
        return Err(StageError::Trunk(rig.name.clone()));
    }
    if poses.len() < FEWEST_STAGE_POSES {
        return Err(StageError::TooFewPoses(poses.len()));
    }
    let model = start::model(rig, poses, options)?;
    let alone = start::poses_alone(rig, poses, options.robust)?;
    let state = start::fitted_to_poses(&model, &alone).ok_or(StageError::Diverged)?;
    let prepared =
        start::prepare(rig, state, poses, |state, pose| state.left_from_right(&model.corrected(state, pose)))?;
    let mut model = Model { pose_of_view: prepared.pose_of_view.clone(), ..model };
    let stated = model.reading_sigma.clone();
    let fitting = Fitting { prepared: &prepared, poses: poses.len(), options };
    let mut fit = fitting.fit(&model, fitting.first())?;
    if let Some(reading_sigma) = play::reading_sigma(&model, &fit) {
        model.reading_sigma = reading_sigma;
        fit = fitting.fit(&model, fitting.again(&fit))?;
    }
    if let Some(returning) = fitting.with_returns(&model, &stated, &fit) {
        (model, fit) = returning;
    }
    let observability = observability::observability(rig, &model, &fit, &alone);
    result::calibration(result::Material {
        rig,
        model,
        fit,
        observability,
        alone: &alone,
        views: &prepared.views,
        usable: &prepared.usable,
    })
}

/// The fits of one calibration: all use the same views.
struct Fitting<'a> {
    prepared: &'a Prepared<State>,
    poses: usize,
    options: &'a StageOptions,
}

impl Fitting<'_> {
    /// The mechanism that comes back to its poses a little differently each time, where views scatter by more than their noise and show it to.
    /// `None` where they do not, or where it cannot be fitted once it is free: what was fitted before stands.
    fn with_returns(&self, model: &Model, stated: &[f64], fit: &Fit<State>) -> Option<(Model, Fit<State>)> {
        fit.covariance.as_ref().filter(|found| found.scatter > MOST_SCATTER)?;
        let mut free = Model { reading_sigma: stated.to_vec(), ..model.with_returns(FREE_RETURNS) };
        let freed = self.fit(&free, self.again(fit)).ok()?;
        let (reading_sigma, return_sigma) = play::sigma_of_returns(&free, &freed, stated)?;
        (free.reading_sigma, free.return_sigma) = (reading_sigma, Some(return_sigma));
        let fit = self.fit(&free, self.again(&freed)).ok()?;
        Some((free, fit))
    }

    fn fit(&self, model: &Model, start: Start<State>) -> Result<Fit<State>, StageError> {
        let task = Task {
            kinematics: model,
            views: &self.prepared.views,
            own_poses: &self.prepared.own_poses,
            lenses: self.prepared.shared.lenses,
            knowledge: &self.options.lenses,
            robust: self.options.robust,
        };
        task.fit(start).map_err(|reason| StageError::Joint(reason.into()))
    }

    /// From the poses alone.
    fn first(&self) -> Start<State> {
        let Prepared { shared, targets, usable, .. } = self.prepared;
        Start { shared: shared.clone(), targets: targets.clone(), usable: usable.clone() }
    }

    /// From another fit, with all corners again.
    fn again(&self, fit: &Fit<State>) -> Start<State> {
        let mut shared = fit.shared.clone();
        shared.state.returns.resize(self.poses, Isometry3::identity());
        Start { shared, targets: fit.targets.clone(), usable: self.prepared.usable.clone() }
    }
}
