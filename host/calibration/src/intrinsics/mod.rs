//! Intrinsic parameters of a lens from views of a target, without an initial guess.
//!
//! 1. A linear start on bearings (`start`).
//! 2. A robust joint adjustment of lens and target poses that finds outliers (`adjust`).
//! 3. Plain least squares on the remaining corners: the result and its covariance.
//! 4. The same with all that a lens may have besides, within what is known of lenses (`prior`): a pupil that moves (`pupil`), elements off
//!    the axis, a target that bows. What the views tell to be absent is left out again (`ladder`).
//! 5. The lens that is left with two more terms of its radius, where the views ask for them (`further`).

mod adjust;
mod bundle;
mod foretold;
mod further;
mod held_out;
mod ladder;
mod lens;
mod model;
mod mounting;
mod observations;
mod prior;
mod pupil;
mod report;
mod result;
mod start;
mod trial;

use vergence_vision::{ImageSize, OpenCvFisheye};

pub(crate) use ladder::LEAST_GAIN;
pub use ladder::{LensStep, StepEvidence, StepVerdict};
pub(crate) use lens::{CENTRAL, LENS};
pub use lens::{LensParameters, Reprojection, reproject};
pub use model::{LensModel, UnknownLensModel};
pub use pupil::PupilEvidence;
pub use result::{IntrinsicsCalibration, IntrinsicsError, Outlier, OutlierReason, Parameter, ViewFigures, ViewPose};

use adjust::robust_fit;
use observations::{ObservedView, observed_views};
use report::report;
use start::{start_from, starts};
use vergence_targets::TargetView;

/// Options of [`calibrate_intrinsics`]. The default suits every lens and any target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntrinsicsOptions {
    /// Whether to estimate how the target bows out of its plane, whatever the views say: two more unknowns. [`LensModel::ByEvidence`]
    /// estimates it where the views do not tell that the target is flat.
    pub warp: bool,
    /// A corner farther from its reprojection than this many times the median distance, both in units of their relative
    /// sigmas, is left out. `None` keeps every corner: plain least squares over all.
    pub outlier_factor: Option<f64>,
    /// Which parameters the lens has besides those of a central and symmetric one.
    pub model: LensModel,
}

impl Default for IntrinsicsOptions {
    /// The views decide on lens and target. 6 median distances: for Gaussian noise of standard deviation σ per axis the median distance is
    /// 1.18 σ, so the limit is 7 σ and noise is never left out.
    fn default() -> Self {
        Self { warp: false, outlier_factor: Some(6.0), model: LensModel::ByEvidence }
    }
}

impl IntrinsicsOptions {
    /// The default with a central lens, as other programs calibrate one.
    #[must_use]
    pub fn central() -> Self {
        Self { model: LensModel::Central, ..Self::default() }
    }
}

/// Calibrates the lens that took `views`: images of `size` pixels of one flat target.
///
/// The views must show the target at two different tilts or more. The result does not depend on the order of the views
/// or of the corners in them.
///
/// # Errors [`IntrinsicsError`] names what is wrong with the input, or what the views do not determine.
pub fn calibrate_intrinsics(
    views: &[TargetView],
    size: ImageSize,
    options: &IntrinsicsOptions,
) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    let (observed_views, left_out) = observed_views(views)?;
    let thinned: Vec<_> = observed_views.iter().map(ObservedView::thinned).collect();
    let state = robust_fit(&thinned, &starts(&thinned, size)).ok_or(IntrinsicsError::NoStart)?;
    let (adjusted, evidence) = ladder::fit(observed_views, state, size, options)?;
    report(views, size, &adjusted, evidence, left_out)
}

/// As [`calibrate_intrinsics`], but starts at the central lens `start`: to update an old calibration.
///
/// # Errors As [`calibrate_intrinsics`], and [`IntrinsicsError::NoStart`] if `start` is not a lens or explains no view.
pub fn refine_intrinsics(
    views: &[TargetView],
    size: ImageSize,
    start: &OpenCvFisheye,
    options: &IntrinsicsOptions,
) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    let (observed_views, left_out) = observed_views(views)?;
    let thinned: Vec<_> = observed_views.iter().map(ObservedView::thinned).collect();
    let start = start_from(start, &thinned, size).ok_or(IntrinsicsError::NoStart)?;
    let state = robust_fit(&thinned, &[start]).ok_or(IntrinsicsError::NoStart)?;
    let (adjusted, evidence) = ladder::fit(observed_views, state, size, options)?;
    report(views, size, &adjusted, evidence, left_out)
}
