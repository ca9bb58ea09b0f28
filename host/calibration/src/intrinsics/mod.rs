//! Intrinsic parameters of a lens from views of a target, without an initial guess.
//!
//! 1. A linear start on bearings (`start`).
//! 2. A robust joint adjustment of lens and target poses that finds outliers (`adjust`).
//! 3. Plain least squares on the remaining corners: the result and its covariance.

mod adjust;
mod bundle;
mod lens;
mod observations;
mod report;
mod result;
mod start;

use vergence_vision::{ImageSize, OpenCvFisheye};

pub(crate) use lens::LENS;
pub use lens::{Reprojection, reproject};
pub use result::{
    IntrinsicsCalibration, IntrinsicsError, Outlier, OutlierReason, Parameter, TargetWarp, ViewFigures, ViewPose,
};

use adjust::{inlier_fit, robust_fit};
use observations::{ObservedView, observed_views};
use report::report;
use start::{start_from, starts};
use vergence_targets::TargetView;

/// Options of [`calibrate_intrinsics`]. The default suits every lens and any flat target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntrinsicsOptions {
    /// Whether to estimate how the target bows out of its plane: two more unknowns.
    pub warp: bool,
    /// A corner farther from its reprojection than this many times the median distance, both in units of their relative
    /// sigmas, is left out. `None` keeps every corner: plain least squares over all.
    pub outlier_factor: Option<f64>,
}

impl Default for IntrinsicsOptions {
    /// A flat target and 6 median distances: for Gaussian noise of standard deviation σ per axis the median distance is
    /// 1.18 σ, so the limit is 7 σ and noise is never left out.
    fn default() -> Self {
        Self { warp: false, outlier_factor: Some(6.0) }
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
    let adjusted = inlier_fit(observed_views, state, options)?;
    report(views, size, &adjusted, left_out)
}

/// As [`calibrate_intrinsics`], but starts at the lens `start`: to update an old calibration.
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
    let adjusted = inlier_fit(observed_views, state, options)?;
    report(views, size, &adjusted, left_out)
}
