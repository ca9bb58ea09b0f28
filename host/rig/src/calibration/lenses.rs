//! What the file of a rig states of its lenses' errors, and lenses that are extrapolated by it.

use nalgebra::SMatrix;
use vergence_vision::{LENS_PARAMETERS, Side};

use super::own_frame::OwnFrame;
use super::{RigCalibration, RigNumber};
use crate::LensField;
use crate::rig::Rig;

/// A rig whose file does not say how far its lenses may be off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the rig file states no covariance of its lenses, so nobody knows how wrong they are beyond the field in which they were measured: \
     use the measured field, or calibrate with camera files that carry a covariance"
)]
pub struct UnknownLensErrors;

impl Rig {
    /// The rig with its lenses used in this `field`. Nothing is asked about how well they are known there.
    #[must_use]
    pub fn with_field(self, field: LensField) -> Self {
        match field {
            LensField::Measured => self,
            LensField::Extrapolated => Self {
                left_camera: self.left_camera.extrapolated(),
                right_camera: self.right_camera.extrapolated(),
                ..self
            },
        }
    }

    /// The rig with its lenses used in this `field`, to measure points whose uncertainty is stated: that of a lens that is extrapolated
    /// comes from the covariance of its parameters.
    ///
    /// # Errors
    /// [`UnknownLensErrors`] where the lenses are to be extrapolated without a covariance.
    pub fn measuring_in(self, field: LensField) -> Result<Self, UnknownLensErrors> {
        let known = [Side::Left, Side::Right].iter().all(|&side| self.lens_covariance(side).is_some());
        if field == LensField::Extrapolated && !known { Err(UnknownLensErrors) } else { Ok(self.with_field(field)) }
    }

    /// The covariance of the parameters of the lens on `side` in the frame of its rays, in the order of
    /// [`LENS_PARAMETERS`]; `None` where the file states none.
    #[must_use]
    pub fn lens_covariance(&self, side: Side) -> Option<SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>> {
        let RigCalibration::Covariance(found) = &self.calibration else { return None };
        let mut covariance = SMatrix::zeros();
        let of_lens = |number: &RigNumber| match number {
            RigNumber::Lens { side: of, parameter } if *of == side => Some(*parameter),
            _ => None,
        };
        let places: Vec<_> =
            found.numbers.iter().enumerate().filter_map(|(index, number)| Some((index, of_lens(number)?))).collect();
        for &(row, of_row) in &places {
            for &(column, of_column) in &places {
                covariance[(of_row, of_column)] = found.covariance[(row, column)];
            }
        }
        let own = OwnFrame::of(self.camera(side), |parameter| places.iter().any(|(_, place)| *place == parameter));
        (!places.is_empty()).then(|| own.map_or(covariance, |own| own.covariance(&covariance)))
    }
}
