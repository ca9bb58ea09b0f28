//! The lens that this program computes with, as one of the camera models.

use nalgebra::Matrix2x3;

use super::{CameraModel, ModelParameter, ParameterUnit, Sight};
use crate::{Angle, Camera, KannalaBrandt, LENS_PARAMETER_NAMES, OpenCvFisheye, OutsideField, Pixel, Point, UnitRay};

impl CameraModel for KannalaBrandt {
    fn name(&self) -> &'static str {
        "Kannala-Brandt"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let OpenCvFisheye { fx, fy, cx, cy, k } = self.to_opencv();
        let values =
            [&[fx, fy, cx, cy][..], &k, &self.pupil().mm(), &self.asymmetry().to_array(), &self.further_terms()]
                .concat();
        let unit = |index| match index {
            0..4 => ParameterUnit::Pixels,
            8 | 9 => ParameterUnit::Millimetres,
            _ => ParameterUnit::One,
        };
        let named = LENS_PARAMETER_NAMES.iter().zip(values).enumerate();
        named.map(|(index, (name, value))| ModelParameter::new(name, unit(index), value)).collect()
    }

    fn half_field(&self) -> Angle {
        self.theta_max()
    }

    fn project(&self, ray: &UnitRay<Camera>) -> Result<Pixel, OutsideField> {
        Self::project(self, ray)
    }

    fn project_point(&self, point: &Point<Camera>) -> Result<Pixel, OutsideField> {
        Self::project_point(self, point)
    }

    fn unproject(&self, pixel: Pixel) -> Result<Sight, OutsideField> {
        let ray = Self::unproject(self, pixel)?;
        Ok(Sight { origin: self.origin_of(&ray), ray })
    }

    fn pixel_by_ray(&self, ray: &UnitRay<Camera>) -> Result<Matrix2x3<f64>, OutsideField> {
        Self::project(self, ray)?;
        Ok(Self::pixel_by_ray(self, ray))
    }

    fn as_kannala_brandt(&self) -> Option<KannalaBrandt> {
        Some(*self)
    }
}
