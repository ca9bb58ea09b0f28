//! The camera models of other programs, behind one trait.
//!
//! A [`CameraModel`] maps rays to pixels and pixels to rays, inside its valid cone. [`KannalaBrandt`], the lens that this program computes
//! with, is one of them; [`fit_lens`] makes it of any other, and [`model_of`] any of them of its name and parameters. The other models are a [`Formula`] each: what it gives for one direction, and
//! where it ends. [`Central`] adds what all of them share: the cone in which no pixel has two rays, and the way back from a pixel.

mod central;
mod double_sphere;
mod eucm;
mod fisheye624;
mod fit;
mod kannala_brandt;
mod mei;
mod named;
mod ocam;
mod pinhole;
mod splined;
mod steps;

use std::fmt::Debug;

use nalgebra::Matrix2x3;

pub use self::central::{Central, Formula};
pub use self::double_sphere::DoubleSphere;
pub use self::eucm::Eucm;
pub use self::fisheye624::Fisheye624;
pub use self::fit::{LensFit, NoFit, SightRegion, fit_lens};
pub use self::mei::Mei;
pub use self::named::model_of;
pub use self::ocam::OCam;
pub use self::pinhole::{Pinhole, Radtan};
pub use self::splined::{SplineGrid, SplinedStereographic};
pub use self::steps::LensSteps;
pub(crate) use self::steps::{AngleLaw, OntoPlane};
use crate::{Angle, Camera, KannalaBrandt, OutsideField, Pixel, Point, UnitRay};

/// A parameter of a camera model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelParameter {
    /// Its name in the program that the model comes from.
    pub name: String,
    /// Its unit.
    pub unit: ParameterUnit,
    /// Its value.
    pub value: f64,
}

/// The unit of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterUnit {
    /// Pixels of the image.
    Pixels,
    /// Millimetres.
    Millimetres,
    /// A number without unit.
    One,
}

impl ModelParameter {
    /// A parameter.
    #[must_use]
    pub fn new(name: &str, unit: ParameterUnit, value: f64) -> Self {
        Self { name: name.to_owned(), unit, value }
    }

    /// The focal lengths and the principal point, which most models have.
    fn pinhole([fx, fy, cx, cy]: [f64; 4]) -> Vec<Self> {
        Self::named(&["fx", "fy", "cx", "cy"], ParameterUnit::Pixels, &[fx, fy, cx, cy])
    }

    fn named(names: &[&str], unit: ParameterUnit, values: &[f64]) -> Vec<Self> {
        names.iter().zip(values).map(|(name, value)| Self::new(name, unit, *value)).collect()
    }
}

/// Where a ray starts and where it goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// The point from which it starts: the optical centre of a central camera.
    pub origin: Point<Camera>,
    /// Its direction.
    pub ray: UnitRay<Camera>,
}

/// A camera model with its parameters.
pub trait CameraModel: Debug + Send + Sync {
    /// The name of the model.
    fn name(&self) -> &'static str;

    /// The parameters in the order of the program that the model comes from.
    fn parameters(&self) -> Vec<ModelParameter>;

    /// Half the angle of the valid cone about the optical axis z. No ray beyond it has a pixel; a ray within may be refused too, where the
    /// model says nothing of its direction.
    fn half_field(&self) -> Angle;

    /// The pixel of a direction.
    ///
    /// # Errors
    /// [`OutsideField`].
    fn project(&self, ray: &UnitRay<Camera>) -> Result<Pixel, OutsideField>;

    /// The pixel of a point.
    ///
    /// # Errors
    /// [`OutsideField`], and for a point at the optical centre.
    fn project_point(&self, point: &Point<Camera>) -> Result<Pixel, OutsideField> {
        self.project(&point.direction().ok_or(OutsideField)?)
    }

    /// The ray that is imaged at `pixel`.
    ///
    /// # Errors
    /// [`OutsideField`]; the ray is never clamped.
    fn unproject(&self, pixel: Pixel) -> Result<Sight, OutsideField>;

    /// The derivative of the pixel by the unit vector of `ray`, in pixels per radian.
    ///
    /// # Errors
    /// [`OutsideField`].
    fn pixel_by_ray(&self, ray: &UnitRay<Camera>) -> Result<Matrix2x3<f64>, OutsideField>;

    /// The model as steps by which arrays are computed, where it has such.
    fn steps(&self) -> Option<LensSteps> {
        None
    }

    /// The same camera as a [`KannalaBrandt`] lens, where it is one.
    fn as_kannala_brandt(&self) -> Option<KannalaBrandt> {
        None
    }
}
