//! Whether the fit of a calibration is good enough to be written.

use crate::Validation;

/// No target and no lens of the model leaves residuals like these, in pixels.
const WORST_RMS_PX: f64 = 3.0;
/// Where more corners are left out, what fits the rest is an accident.
const FEWEST_INLIERS: f64 = 0.7;

/// Why a calibration must not be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unfit {
    /// The best fit leaves residuals of this root mean square, in pixels.
    #[error("the best fit is {0:.1} px off: target, images or cameras are not what they are said to be")]
    Residuals(f64),
    /// Too many corners were left out.
    #[error("only {inlier} of {total} corners fit together: were images, corners or cameras mixed up?")]
    Corners {
        /// Number of corners used.
        inlier: usize,
        /// Number of all corners.
        total: usize,
    },
    /// The views that were held out contradict the calibration.
    #[error(
        "views that the calibration did not see fit to {held_out_px:.3} px rms only, those that it saw to {rms_px:.3} px: take \
         more views"
    )]
    HeldOut {
        /// Root mean square of the views that were held out, in pixels.
        held_out_px: f64,
        /// Root mean square of the views used, in pixels.
        rms_px: f64,
    },
}

/// The check that every calibration must pass before anything is written: root mean square over the corners used in pixels,
/// number of corners used, number of all corners.
///
/// # Errors
/// [`Unfit`].
pub fn check_fit(rms_inlier_px: f64, corners_inlier: usize, corners_total: usize) -> Result<(), Unfit> {
    if rms_inlier_px.is_nan() || rms_inlier_px > WORST_RMS_PX {
        return Err(Unfit::Residuals(rms_inlier_px));
    }
    if (corners_inlier as f64) < FEWEST_INLIERS * corners_total as f64 {
        return Err(Unfit::Corners { inlier: corners_inlier, total: corners_total });
    }
    Ok(())
}

impl Validation {
    /// Checks that the views held out do not contradict a calibration whose own views fit to `rms_px` pixels.
    ///
    /// # Errors
    /// [`Unfit::HeldOut`].
    pub fn check(&self, rms_px: f64) -> Result<(), Unfit> {
        match self.is_sound(rms_px) {
            true => Ok(()),
            false => Err(Unfit::HeldOut { held_out_px: self.rms_px, rms_px }),
        }
    }
}
