//! A lens's intrinsic parameters from views of a board, with no guess asked.
//!
//! 1. A linear start on bearings (`start`).
//! 2. A robust joint adjustment of lens and board poses that finds the gross errors (`adjust`).
//! 3. Plain least squares on the corners that remain: the result, and the covariance of everything.

mod adjust;
mod bundle;
mod cone;
mod lens;
mod report;
mod result;
mod sights;
mod start;

use vergence_vision::{ImageSize, OpenCvFisheye};

pub(crate) use lens::LENS;
pub use lens::{Reprojection, reproject};
pub use result::{
    BoardWarp, IntrinsicsCalibration, IntrinsicsError, Outlier, OutlierReason, Parameter, ViewFigures, ViewPose,
};

use crate::BoardView;
use adjust::{inlier_fit, robust_fit};
use report::report;
use sights::{Sighting, sightings};
use start::{start_from, starts};

/// How to calibrate. The default suits every board and lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntrinsicsOptions {
    /// Whether to estimate how the board bows out of its plane: two more unknowns.
    pub warp: bool,
    /// A corner farther from its reprojection than this many times the median distance, both in units of their relative
    /// sigmas, is left out. `None` keeps every corner: plain least squares over all.
    pub outlier_factor: Option<f64>,
}

impl Default for IntrinsicsOptions {
    /// A flat board. For Gaussian noise of standard deviation σ per axis the median distance is 1.18 σ, so that 6 of
    /// them are 7 σ: what is left out is no noise.
    fn default() -> Self {
        Self { warp: false, outlier_factor: Some(6.0) }
    }
}

/// Calibrates the lens that took `views`, images of `size`, of one flat board.
///
/// The views must show the board at two different tilts at least. The result does not depend on the order of the views
/// or of the corners in them.
///
/// # Errors
/// [`IntrinsicsError`] names what is wrong with the input, or what the views leave undetermined.
pub fn calibrate_intrinsics(
    views: &[BoardView],
    size: ImageSize,
    options: &IntrinsicsOptions,
) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    let (sightings, left_out) = sightings(views)?;
    let thinned: Vec<_> = sightings.iter().map(Sighting::thinned).collect();
    let state = robust_fit(&thinned, &starts(&thinned, size)).ok_or(IntrinsicsError::NoStart)?;
    let adjusted = inlier_fit(sightings, state, options)?;
    report(views, size, &adjusted, left_out)
}

/// As [`calibrate_intrinsics`], but starts at a lens that is known: to bring an old calibration up to date.
///
/// # Errors
/// As [`calibrate_intrinsics`], and [`IntrinsicsError::NoStart`] where `start` is not a lens or explains no view.
pub fn refine_intrinsics(
    views: &[BoardView],
    size: ImageSize,
    start: &OpenCvFisheye,
    options: &IntrinsicsOptions,
) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    let (sightings, left_out) = sightings(views)?;
    let thinned: Vec<_> = sightings.iter().map(Sighting::thinned).collect();
    let start = start_from(start, &thinned, size).ok_or(IntrinsicsError::NoStart)?;
    let state = robust_fit(&thinned, &[start]).ok_or(IntrinsicsError::NoStart)?;
    let adjusted = inlier_fit(sightings, state, options)?;
    report(views, size, &adjusted, left_out)
}
