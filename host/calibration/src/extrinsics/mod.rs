//! Relative pose of two cameras from targets that both see, by bundles of rays; no image is rectified.
//!
//! Each camera alone places the targets ([`target_pose`](crate::target_pose)); fitting both sets of corners to each
//! other ([`fit_rotation_translation`](crate::fit_rotation_translation)) gives a first relative pose; a joint fit of
//! all reprojections refines everything. Targets may be near and beyond 90° from the axis.

mod bow;
mod fit;
mod initial;
mod joint;
mod labels;
mod outliers;
mod report;
mod stereo;

use nalgebra::{DMatrix, SMatrix};
use vergence_rig::{CalibratedNumbers, InvalidCovariance, RigNumber};
use vergence_targets::{Corner, Target, TargetView};
use vergence_vision::{InvalidLens, KannalaBrandt, Left, Pixel, Right, Transform};

use crate::planar_pose::PoseError;
use crate::reprojection::POSE;
use crate::schur_lm::Clustered;
use crate::{TargetShape, TargetWarp};

pub(crate) use fit::{Fit, NoFit, Start, Task};
pub(crate) use initial::{PlacedView, inside, nearer_targets, place};
pub(crate) use joint::{FixedPose, Kinematics, Shared};
pub use labels::{LabelError, label_pairs};
pub(crate) use outliers::OwnPoses;
pub(crate) use report::{outliers, refined, rms, view_figures};
pub use stereo::LensKnowledge;
pub(crate) use stereo::{Lenses, Pair};
pub use vergence_vision::Side;

/// Least number of views: fewer cannot contradict each other.
pub const FEWEST_VIEWS: usize = 3;

/// One target seen by both cameras while neither moved against the other. Corners may be missing in either image.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoView {
    /// Name of the view, for reports.
    pub name: String,
    /// Corners in the left image.
    pub left: TargetView,
    /// Corners in the right image.
    pub right: TargetView,
}

/// Options of [`calibrate_extrinsics`].
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsOptions {
    /// Prior knowledge of both lenses.
    pub lenses: LensKnowledge,
    /// Whether outliers are found by a robust loss and left out.
    pub robust: bool,
}

impl Default for ExtrinsicsOptions {
    /// Lenses exactly as given, outliers left out.
    fn default() -> Self {
        Self { lenses: LensKnowledge::Exact, robust: true }
    }
}

/// A relative pose and its residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePose {
    /// The right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// Distance between corners and reprojections, root mean square per corner of both cameras, in pixels.
    pub rms_px: f64,
}

/// A calibrated pair.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsCalibration {
    /// Start of the joint fit: the targets placed by each camera alone, both sets of corners fitted to each other (K.
    /// Arun et al., 1987).
    pub arun: RelativePose,
    /// Optimum of the joint fit; its `rms_px` is over all corners, outliers included.
    pub joint: RelativePose,
    /// Covariance of `joint` in local coordinates `[ω, δ]`: rotation vector about the left axes in radians, then the
    /// position of the right camera in the left frame in millimetres. It counts that the corners of a view err together
    /// ([`crate::schur_lm::SchurNormal::clustered`]).
    pub covariance: SMatrix<f64, POSE, POSE>,
    /// The same if the errors of all corners were independent of each other: noise alone.
    pub noise_covariance: SMatrix<f64, POSE, POSE>,
    /// How much more the views pull pose and lenses to and fro than independent noise of their corners explains: a ratio
    /// of standard deviations, at least 1. More means wrong lenses, images taken at different instants, or a target that
    /// bends.
    pub view_scatter: f64,
    /// As `covariance`, with that of both lenses and all correlations behind it where the lenses were refined.
    pub full_covariance: DMatrix<f64>,
    /// The lens parameters in the last rows of `full_covariance`; none where the lenses were held exact.
    pub lens_numbers: Vec<RigNumber>,
    /// Root mean square distance per corner without outliers, in pixels.
    pub rms_inlier_px: f64,
    /// Standard deviation of one pixel coordinate, root mean square over the corners used.
    pub sigma_px: f64,
    /// Bow of the target where the views show one; both cameras see it flat otherwise.
    pub warp: Option<TargetWarp>,
    /// Left lens, refined unless it was held exact.
    pub left: KannalaBrandt,
    /// Right lens, refined unless it was held exact.
    pub right: KannalaBrandt,
    /// Number of corners in all views that took part, both cameras.
    pub corners_total: usize,
    /// Number of corners used: all but the outliers.
    pub corners_inlier: usize,
    /// Figures of each view that took part.
    pub views: Vec<StereoViewFigures>,
    /// The corners left out.
    pub outliers: Vec<StereoOutlier>,
    /// The views that did not take part.
    pub skipped: Vec<SkippedView>,
}

impl ExtrinsicsCalibration {
    /// The numbers of the pair's rig file with their covariance, which covers the scatter of the views.
    ///
    /// # Errors
    /// [`InvalidCovariance`] where rounding made it none.
    pub fn numbers(&self) -> Result<CalibratedNumbers, InvalidCovariance> {
        let turn = (0..3).map(|component| RigNumber::RightTurn { component });
        let shift = (0..3).map(|component| RigNumber::RightShift { component });
        let refined = self.lens_numbers.iter().copied();
        CalibratedNumbers::new(turn.chain(shift).chain(refined).collect(), self.full_covariance.clone())
    }
}

/// Residuals of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoViewFigures {
    /// Name of the view.
    pub view: String,
    /// Pose of the target in the left frame.
    pub left_from_target: Transform<Left, Target>,
    /// Root mean square distance of the used corners of the left and the right camera, in pixels; `None` without any.
    pub rms_px: [Option<f64>; 2],
    /// Number of used corners of the left and the right camera.
    pub corners: [usize; 2],
}

/// A corner left out.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoOutlier {
    /// The view's name.
    pub view: String,
    /// The camera.
    pub side: Side,
    /// Position of the corner on the target, in millimetres.
    pub target_mm: [f64; 2],
    /// Observed position in the image.
    pub pixel: Pixel,
    /// Distance from its reprojection, in pixels.
    pub error_px: f64,
    /// Reason for leaving it out.
    pub reason: StereoOutlierReason,
}

/// Why a corner is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StereoOutlierReason {
    /// Much further than others from where the rest of its own image places it.
    Gross,
    /// Outside the lens's valid cone.
    OutsideField,
    /// The cameras disagree on the whole view, or too few of its corners are usable.
    ViewRejected,
}

impl std::fmt::Display for StereoOutlierReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Gross => "too far from where the rest of its image puts it",
            Self::OutsideField => "outside the lens's valid cone",
            Self::ViewRejected => "the cameras disagree on the whole view, or too few corners were left",
        })
    }
}

/// A view without information on the relative pose.
#[derive(Clone, Debug, PartialEq)]
pub struct SkippedView {
    /// Name of the view.
    pub view: String,
    /// The camera that cannot place the target.
    pub side: Side,
    /// Why not.
    pub reason: PoseError,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtrinsicsError {
    /// The two lists of views differ in length.
    #[error("{left} views of the left camera and {right} of the right do not pair")]
    ViewsDoNotPair {
        /// Views of the left camera.
        left: usize,
        /// Views of the right camera.
        right: usize,
    },
    /// Too few views in which both cameras place the target.
    #[error("{usable} views in which both cameras see enough of the target; at least {FEWEST_VIEWS} are needed")]
    TooFewViews {
        /// Number of such views.
        usable: usize,
    },
    /// A view contradicts itself.
    #[error("view '{view}', {side} camera: {reason}")]
    View {
        /// Name of the view.
        view: String,
        /// The camera.
        side: Side,
        /// The reason why the target's pose cannot be found.
        reason: PoseError,
    },
    /// The corners leave an unknown open: too few views for lenses that are free, or all targets alike.
    #[error("the views do not determine the calibration: add targets at other places and tilts, or hold the lenses")]
    NotDetermined,
    /// The iteration ended at no optimum.
    #[error("the views contradict each other: no relative pose fits them")]
    Diverged,
    /// A covariance of a lens is not symmetric and positive.
    #[error("the covariance of a lens is not positive definite")]
    LensCovariance,
    /// The refined parameters are not a lens.
    #[error("the refined {side} lens: {lens}")]
    Lens {
        /// The camera.
        side: Side,
        /// Why not.
        lens: InvalidLens,
    },
}

impl From<NoFit> for ExtrinsicsError {
    fn from(reason: NoFit) -> Self {
        match reason {
            NoFit::NotDetermined => Self::NotDetermined,
            NoFit::Diverged => Self::Diverged,
            NoFit::NotACovariance => Self::LensCovariance,
        }
    }
}

impl StereoView {
    /// Pairs the images of two cameras in their order. A view is called after its left image.
    ///
    /// # Errors
    /// [`ExtrinsicsError::ViewsDoNotPair`] where one camera has more than the other.
    pub fn pair(left: &[TargetView], right: &[TargetView]) -> Result<Vec<Self>, ExtrinsicsError> {
        if left.len() != right.len() {
            return Err(ExtrinsicsError::ViewsDoNotPair { left: left.len(), right: right.len() });
        }
        let pair = |(left, right): (&TargetView, &TargetView)| Self {
            name: left.name.clone(),
            left: left.clone(),
            right: right.clone(),
        };
        Ok(left.iter().zip(right).map(pair).collect())
    }

    /// All corners, the left camera's first.
    pub fn corners(&self) -> impl Iterator<Item = (Side, &Corner)> {
        let left = self.left.corners.iter().map(|corner| (Side::Left, corner));
        left.chain(self.right.corners.iter().map(|corner| (Side::Right, corner)))
    }
}

/// Calibrates the relative pose of two cameras, and refines their lenses if the options allow it.
///
/// Starts with K. Arun et al. 1987 on the targets as each camera places them, then least squares on the reprojection
/// over the relative pose, every target pose and the lenses: first with Huber's loss, then without it and without
/// outliers, which are more than six medians from where the rest of their own image places them.
///
/// # Errors [`ExtrinsicsError`] if views are too few, contradict themselves or do not determine an unknown.
pub fn calibrate_extrinsics(
    left: &KannalaBrandt,
    right: &KannalaBrandt,
    views: &[StereoView],
    options: &ExtrinsicsOptions,
) -> Result<ExtrinsicsCalibration, ExtrinsicsError> {
    let lenses = Lenses::of(left, right);
    let (placed, skipped) = place(left, right, views)?;
    if placed.len() < FEWEST_VIEWS {
        return Err(ExtrinsicsError::TooFewViews { usable: placed.len() });
    }
    let arun = initial::arun(views, &placed)?;
    let targets = nearer_targets(lenses, &arun, views, &placed);
    let views: Vec<StereoView> = placed.iter().filter_map(|place| views.get(place.view)).cloned().collect();
    let usable: Vec<Vec<bool>> = views.iter().map(|view| inside(left, right, view)).collect();
    let own_poses: Vec<OwnPoses> = placed.iter().map(PlacedView::own_poses).collect();
    let task = Task {
        kinematics: &FixedPose,
        views: &views,
        own_poses: &own_poses,
        lenses,
        knowledge: &options.lenses,
        robust: options.robust,
    };
    let flat = Shared { state: arun, lenses, shape: TargetShape::FLAT };
    let arun_errors = task.errors_px(&flat, &targets);
    let fit = task.fit(Start { shared: flat, targets, usable: usable.clone() })?;

    let Clustered { covariance, scatter } = fit.covariance.as_ref().ok_or(ExtrinsicsError::NotDetermined)?;
    let noise = fit.noise_covariance.as_ref().ok_or(ExtrinsicsError::NotDetermined)?;
    let relative = |pose, rms_px| RelativePose { left_from_right: Transform::from_isometry(pose), rms_px };
    let every = rms(&fit.errors_px, &usable).unwrap_or_default();
    Ok(ExtrinsicsCalibration {
        arun: relative(arun, rms(&arun_errors, &usable).unwrap_or_default()),
        joint: relative(fit.shared.state, every),
        covariance: covariance.fixed_view::<POSE, POSE>(0, 0).into_owned(),
        noise_covariance: noise.fixed_view::<POSE, POSE>(0, 0).into_owned(),
        view_scatter: *scatter,
        full_covariance: covariance.clone(),
        lens_numbers: fit.lens_numbers.clone(),
        rms_inlier_px: rms(&fit.errors_px, &fit.inliers).unwrap_or_default(),
        sigma_px: fit.sigma_px(&views),
        warp: fit.warp,
        left: refined(&fit.shared.lenses.left, left, Side::Left)?,
        right: refined(&fit.shared.lenses.right, right, Side::Right)?,
        corners_total: usable.iter().map(Vec::len).sum(),
        corners_inlier: fit.inliers.iter().flatten().filter(|&&inlier| inlier).count(),
        views: view_figures(&views, &fit),
        outliers: outliers(&views, &usable, &fit),
        skipped,
    })
}
