//! What all central camera models share: the cone in which no pixel has two rays, and the way back from a pixel.

use std::fmt::Debug;

use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};

use super::{CameraModel, LensSteps, ModelParameter, Sight};
use crate::{Angle, Camera, InvalidLens, OutsideField, Pixel, Point, UnitRay};

/// The formula of a central camera model: the pixel of a direction.
pub trait Formula: Debug + Send + Sync {
    /// The name of the model.
    fn name(&self) -> &'static str;

    /// The parameters in the order of the program that the model comes from.
    fn parameters(&self) -> Vec<ModelParameter>;

    /// Checks the ranges of the parameters, which are all finite.
    ///
    /// # Errors
    /// [`InvalidLens`] names the parameter.
    fn check(&self) -> Result<(), InvalidLens>;

    /// The angle to the axis where the formula ends, in radians, below π.
    fn ends(&self) -> f64;

    /// The pixel of the unit vector `direction`, no farther from the axis than [`Self::ends`]. `None` where the formula says nothing of it.
    fn image(&self, direction: &Vector3<f64>) -> Option<Pixel>;

    /// The formula as steps by which arrays are computed, where it has such.
    fn steps(&self) -> Option<LensSteps> {
        None
    }
}

/// A central camera: a [`Formula`] within its valid cone.
///
/// The cone ends where the formula does, or where the image begins to fold over, whichever comes first; of that angle it is 99 %, because
/// beside the end the ray of a pixel is not determined well.
#[derive(Clone, Debug, PartialEq)]
pub struct Central<F> {
    formula: F,
    half_field: f64,
    axis: Pixel,
}

/// Share of the angle where a model ends that is used.
const USED: f64 = 0.99;
/// Rings and spokes on which the formula is looked at for folds.
const RINGS: u32 = 720;
const SPOKES: u32 = 24;
/// Step of numerical derivatives, in radians.
const STEP: f64 = 1e-6;

impl<F: Formula> Central<F> {
    /// Checks the parameters and finds the valid cone.
    ///
    /// # Errors
    /// [`InvalidLens`] where a parameter is out of its range, or the image folds over at the axis.
    pub fn new(formula: F) -> Result<Self, InvalidLens> {
        if !formula.parameters().iter().all(|parameter| parameter.value.is_finite()) {
            return Err(InvalidLens::NotFinite);
        }
        formula.check()?;
        let axis = formula.image(&Vector3::z()).ok_or(InvalidLens::FoldsAtAxis)?;
        let half_field = USED * unfolded(&formula, axis);
        if half_field > 0.0 { Ok(Self { formula, half_field, axis }) } else { Err(InvalidLens::FoldsAtAxis) }
    }

    /// The formula.
    #[must_use]
    pub const fn formula(&self) -> &F {
        &self.formula
    }

    fn image(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.formula
            .image(direction)
            .map(|pixel| Vector2::new(pixel.u, pixel.v))
            .filter(|at| at.x.is_finite() && at.y.is_finite())
    }

    /// Two directions across `direction`, and the derivative of the pixel along them.
    fn slopes(&self, direction: &Vector3<f64>) -> Option<(Matrix3x2<f64>, Matrix2<f64>)> {
        let across = directions_across(direction);
        let mut slopes = Matrix2::zeros();
        for (index, along) in across.column_iter().enumerate() {
            let [ahead, behind] = [STEP, -STEP].map(|step| self.image(&(direction + along * step).normalize()));
            slopes.set_column(index, &((ahead? - behind?) / (2.0 * STEP)));
        }
        Some((across, slopes))
    }

    /// A direction near the ray of the pixel that lies `away` from the image of the axis: the one at the same distance from it.
    fn near(&self, away: Vector2<f64>) -> Vector3<f64> {
        let distance = away.norm();
        if distance == 0.0 {
            return Vector3::z();
        }
        let (cosine, sine) = (away.x / distance, away.y / distance);
        let at = |theta: f64| Vector3::new(theta.sin() * cosine, theta.sin() * sine, theta.cos());
        let (mut low, mut high) = (0.0, self.half_field);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let seen = self.image(&at(middle)).map(|seen| (seen - self.axis()).norm());
            if seen.is_some_and(|seen| seen < distance) { low = middle } else { high = middle }
        }
        at(low)
    }

    fn axis(&self) -> Vector2<f64> {
        Vector2::new(self.axis.u, self.axis.v)
    }
}

impl<F: Formula> CameraModel for Central<F> {
    fn name(&self) -> &'static str {
        self.formula.name()
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        self.formula.parameters()
    }

    fn half_field(&self) -> Angle {
        Angle::from_rad(self.half_field)
    }

    fn steps(&self) -> Option<LensSteps> {
        self.formula.steps()
    }

    fn project(&self, ray: &UnitRay<Camera>) -> Result<Pixel, OutsideField> {
        if ray.angle_to_axis().rad() > self.half_field {
            return Err(OutsideField);
        }
        self.formula.image(&ray.vector()).ok_or(OutsideField)
    }

    fn unproject(&self, pixel: Pixel) -> Result<Sight, OutsideField> {
        /// Newton's method ends within this distance of the pixel, or this share of its own from zero, and with this step in radians.
        const NEAR_PX: f64 = 1e-6;
        const NEAR_SHARE: f64 = 1e-12;
        const SMALLEST: f64 = 1e-15;
        const LONGEST: f64 = 0.1;
        let wanted = Vector2::new(pixel.u, pixel.v);
        if !(wanted.x.is_finite() && wanted.y.is_finite()) {
            return Err(OutsideField);
        }
        let mut direction = self.near(wanted - self.axis());
        for _ in 0..50 {
            let (across, slopes) = self.slopes(&direction).ok_or(OutsideField)?;
            let missing = wanted - self.image(&direction).ok_or(OutsideField)?;
            let step = slopes.try_inverse().ok_or(OutsideField)? * missing;
            direction = (direction + across * step * (LONGEST / step.norm()).min(1.0)).normalize();
            if step.norm() <= SMALLEST {
                break;
            }
        }
        let off = (wanted - self.image(&direction).ok_or(OutsideField)?).norm();
        let near = NEAR_PX + NEAR_SHARE * wanted.norm();
        let ray = UnitRay::new(direction).filter(|ray| off <= near && ray.angle_to_axis().rad() <= self.half_field);
        Ok(Sight { origin: Point::from_mm(Vector3::zeros()), ray: ray.ok_or(OutsideField)? })
    }

    fn pixel_by_ray(&self, ray: &UnitRay<Camera>) -> Result<Matrix2x3<f64>, OutsideField> {
        self.project(ray)?;
        let (across, slopes) = self.slopes(&ray.vector()).ok_or(OutsideField)?;
        Ok(slopes * across.transpose())
    }
}

/// Two unit vectors across `direction` and each other.
fn directions_across(direction: &Vector3<f64>) -> Matrix3x2<f64> {
    let other = if direction.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let first = direction.cross(&other).normalize();
    Matrix3x2::from_columns(&[first, direction.cross(&first)])
}

/// The angle to the axis, in radians, up to which the image of growing rings grows along every spoke and keeps its orientation.
fn unfolded(formula: &impl Formula, axis: Pixel) -> f64 {
    let ends = formula.ends();
    let ring = |index: u32| -> Vec<Option<Vector2<f64>>> {
        let (sine, cosine) = (ends * f64::from(index) / f64::from(RINGS)).sin_cos();
        let spoke = |spoke: u32| std::f64::consts::TAU * f64::from(spoke) / f64::from(SPOKES);
        let direction = |phi: f64| Vector3::new(sine * phi.cos(), sine * phi.sin(), cosine);
        (0..=SPOKES)
            .map(|n| formula.image(&direction(spoke(n))).map(|at| Vector2::new(at.u - axis.u, at.v - axis.v)))
            .collect()
    };
    let mut inner = ring(1);
    for index in 2..RINGS {
        let outer = ring(index);
        let grows = |spoke: usize| {
            let (Some(Some(here)), Some(Some(out)), Some(Some(beside))) =
                (inner.get(spoke), outer.get(spoke), inner.get(spoke + 1))
            else {
                return true;
            };
            let (along, across) = (out - here, beside - here);
            along.dot(here) > 0.0 && along.perp(&across) > 0.0
        };
        if !(0..SPOKES as usize).all(grows) {
            return ends * f64::from(index - 2) / f64::from(RINGS);
        }
        inner = outer;
    }
    ends
}
