//! Result of an intrinsics calibration: the lens, its covariance, residuals and outliers.

use std::fmt;

use nalgebra::SMatrix;
use vergence_targets::Target;
use vergence_vision::{Camera, InvalidLens, KannalaBrandt, OpenCvFisheye, Transform};

use super::lens::{LENS, LensParameters};
use super::{PupilEvidence, StepEvidence};
use crate::TargetWarp;

/// A calibrated lens.
#[derive(Clone, Debug, PartialEq)]
pub struct IntrinsicsCalibration {
    /// The lens with its valid cone: the angle to the axis of the outermost corner used and 5 % more, but less than the
    /// angle where r(θ) stops growing.
    pub camera: KannalaBrandt,
    /// The same lens in the parameters that were estimated, without its pupil, its asymmetry and its further radial
    /// terms. [`KannalaBrandt`] holds them rescaled: its five
    /// coefficients are fx (1, k1, k2, k3, k4) in pixels, its aspect is fy / fx.
    pub opencv: OpenCvFisheye,
    /// What the views say of the pupil; its coefficients are those of `camera`.
    pub pupil: PupilEvidence,
    /// What the views say of the parameters that the lens may have besides.
    pub steps: Vec<StepEvidence>,
    /// Covariance of the parameters in the order of [`LENS_PARAMETERS`](vergence_vision::LENS_PARAMETERS), zero of those that the lens does not
    /// have, target poses marginalised, as the views scatter: it counts that the corners of a view err together, because the lens is not
    /// quite of the model's family or the target bends
    /// ([`crate::schur_lm::SchurNormal::clustered`]).
    pub covariance: SMatrix<f64, LENS, LENS>,
    /// The same if the errors of all corners were independent of each other: noise alone.
    pub noise_covariance: SMatrix<f64, LENS, LENS>,
    /// How much more the views pull the lens to and fro than independent noise of their corners explains: a ratio of standard
    /// deviations, at least 1.
    pub view_scatter: f64,
    /// Bow of the target, if [`crate::IntrinsicsOptions::warp`] asked for it or the views do not tell that there is none.
    pub warp: Option<TargetWarp>,
    /// Root mean square distance √(mean(dx² + dy²)) between corners and reprojections over all corners of the views
    /// used, in pixels.
    pub rms_px: f64,
    /// Root mean square distance over the corners used, in pixels.
    pub rms_inlier_px: f64,
    /// Estimated noise of a corner's u or v in pixels: the residuals' standard deviation after the degrees of freedom,
    /// root mean square over corners of different sigmas.
    pub sigma0_px: f64,
    /// Number of corners given.
    pub corners_total: usize,
    /// Number of corners used.
    pub corners_inlier: usize,
    /// Number of views used.
    pub views_used: usize,
    /// Largest angle between the planes of two targets; it determines how well the focal length is known.
    pub tilt_spread: vergence_vision::Angle,
    /// The angle to the axis of the outermost corner used.
    pub outermost: vergence_vision::Angle,
    /// Figures of each view given, in their order.
    pub views: Vec<ViewFigures>,
    /// Every corner left out, by view and corner.
    pub outliers: Vec<Outlier>,
}

impl IntrinsicsCalibration {
    /// The parameters that were estimated, in the order of the covariance.
    #[must_use]
    pub const fn lens(&self) -> LensParameters {
        LensParameters {
            central: self.opencv,
            pupil: self.camera.pupil(),
            asymmetry: self.camera.asymmetry(),
            further: self.camera.further_terms(),
            foreign: None,
        }
    }
}

/// Residuals and pose of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewFigures {
    /// Name of the view.
    pub name: String,
    /// Corners given.
    pub corners: usize,
    /// Number of corners used; 0 for a view left out.
    pub corners_inlier: usize,
    /// Root mean square distance of all its corners, in pixels; `None` for a view left out.
    pub rms_px: Option<f64>,
    /// Root mean square distance of the corners used, in pixels; `None` for a view left out.
    pub rms_inlier_px: Option<f64>,
    /// Pose of the target; `None` for a view left out.
    pub pose: Option<ViewPose>,
}

/// Pose of the target in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewPose {
    /// Pose of the target in the camera frame.
    pub camera_from_target: Transform<Camera, Target>,
    /// Covariance of a small turn ω (radians) and shift δ (millimetres) in the camera's axes, R ← exp(ω) R, t ← t + δ,
    /// with the lens's uncertainty included.
    pub covariance: SMatrix<f64, 6, 6>,
}

/// A corner that was left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Index of the view in the list given.
    pub view: usize,
    /// Index of the corner in the view.
    pub corner: usize,
    /// Distance from its reprojection in pixels; `None` without a reprojection.
    pub residual_px: Option<f64>,
    /// Reason for leaving it out.
    pub reason: OutlierReason,
}

/// Why a corner was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutlierReason {
    /// It is too far from its reprojection: see [`crate::IntrinsicsOptions::outlier_factor`].
    TooFar,
    /// The view of this corner has too few corners to determine the target's pose.
    ViewTooSmall,
    /// The corners of its view lie on a line.
    ViewOnALine,
    /// Most corners of its view are too far from their reprojections.
    ViewDisagrees,
}

impl fmt::Display for OutlierReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooFar => "too far from its reprojection",
            Self::ViewTooSmall => "too few corners in the view",
            Self::ViewOnALine => "the view's corners lie on a line",
            Self::ViewDisagrees => "most corners of the view are too far from their reprojections",
        })
    }
}

/// A group of lens parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// fx and fy.
    FocalLength,
    /// cx and cy.
    PrincipalPoint,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FocalLength => "focal length",
            Self::PrincipalPoint => "principal point",
        })
    }
}

/// Why views do not give a calibration.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntrinsicsError {
    /// Too few views given.
    #[error("{views} views given, at least {needed} with different tilts are needed")]
    TooFewViews {
        /// Views given.
        views: usize,
        /// Views needed.
        needed: usize,
    },
    /// A coordinate is infinite or not a number, or a relative sigma not a positive one.
    #[error("corner {corner} of view {view} is not a finite number, or its sigma is not positive")]
    NotFinite {
        /// Index of the view.
        view: usize,
        /// Index of the corner in it.
        corner: usize,
    },
    /// A place on the target or in the image is listed twice in one view.
    #[error("corner {corner} of view {view} is at the same place as an earlier one, on the target or in the image")]
    DuplicateCorner {
        /// Index of the view.
        view: usize,
        /// Index of the later corner in it.
        corner: usize,
    },
    /// Too few views have enough corners, not all on a line.
    #[error("{usable_views} views have {corners} corners or more that are not on one line, {needed_views} are needed")]
    TooFewCorners {
        /// Views with enough corners.
        usable_views: usize,
        /// Such views needed.
        needed_views: usize,
        /// Corners a view needs.
        corners: usize,
    },
    /// No lens explains any view.
    #[error("no lens explains the views: are the corners and the target what they are said to be?")]
    NoStart,
    /// Most views contradict the lens that fits the others.
    #[error("only {views} views agree on one lens, {needed} are needed: were corners or images mixed up?")]
    ViewsDisagree {
        /// Views that agree.
        views: usize,
        /// Views needed.
        needed: usize,
    },
    /// All targets have nearly the same orientation, which leaves focal length and distance exchangeable.
    #[error("all targets are parallel within {spread:.2}: tilt the target between the views")]
    ParallelViews {
        /// Largest angle between two targets.
        spread: vergence_vision::Angle,
    },
    /// The views fit many lenses nearly as well.
    #[error("the views do not determine the {parameter}: its standard deviation would be {sigma_px:.1} px")]
    Undetermined {
        /// The parameter that the views do not determine.
        parameter: Parameter,
        /// Standard deviation of the parameter's effect on the image, in pixels.
        sigma_px: f64,
    },
    /// As [`Self::Undetermined`], to the last digit: two unknowns act alike, or there are more of them than corners.
    #[error("the views do not determine the lens: some of its parameters are exchangeable")]
    Singular,
    /// The adjustment did not come to rest.
    #[error("the adjustment found no minimum: the views do not determine the lens")]
    NotConverged,
    /// The best fit is not a lens.
    #[error("the best fit is not a lens: {0}")]
    NotALens(InvalidLens),
}
