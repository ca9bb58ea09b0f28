//! The double sphere model.
//!
//! V. Usenko, N. Demmel, D. Cremers, "The double sphere camera model", 3DV 2018, eq. 40 to 45: a point goes to the unit sphere, from there to a
//! second one that is shifted by ξ, and from there to the image plane, whose pinhole is shifted by α / (1 - α).

use nalgebra::Vector3;

use super::{Formula, ModelParameter, ParameterUnit};
use crate::{InvalidLens, Pixel};

/// The double sphere model, of Kalibr (`ds`) and Basalt (`ds`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleSphere {
    /// Focal lengths fx, fy and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// Shift ξ of the second sphere, -1 to 1.
    pub xi: f64,
    /// Share α of the second sphere, 0 to 1.
    pub alpha: f64,
}

impl Formula for DoubleSphere {
    fn name(&self) -> &'static str {
        "double sphere"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let own = ModelParameter::named(&["xi", "alpha"], ParameterUnit::One, &[self.xi, self.alpha]);
        [ModelParameter::pinhole(self.pinhole), own].concat()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        positive(&self.pinhole)?;
        must("xi", self.xi, (-1.0..=1.0).contains(&self.xi), "lie between -1 and 1")?;
        must("alpha", self.alpha, (0.0..=1.0).contains(&self.alpha), "lie between 0 and 1")
    }

    fn ends(&self) -> f64 {
        let first = plane_shift(self.alpha);
        let second = (first + self.xi) / (2.0 * first * self.xi + self.xi * self.xi + 1.0).sqrt();
        (-second.min(1.0)).acos()
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let shifted = self.xi * d.norm() + d.z;
        let second = d.x.hypot(d.y).hypot(shifted);
        Some(on_plane(self.pinhole, [d.x, d.y], self.alpha * second + (1.0 - self.alpha) * shifted))
    }
}

/// Where the plane of a unified model begins behind its sphere: z > -w of the distance from the sphere's centre.
pub(super) fn plane_shift(alpha: f64) -> f64 {
    if alpha > 0.5 { (1.0 - alpha) / alpha } else { alpha / (1.0 - alpha) }
}

/// The pixel of (x, y) over `depth`.
pub(super) fn on_plane([fx, fy, cx, cy]: [f64; 4], [x, y]: [f64; 2], depth: f64) -> Pixel {
    Pixel { u: fx * x / depth + cx, v: fy * y / depth + cy }
}

/// Refuses focal lengths that are not positive.
pub(super) fn positive([fx, fy, ..]: &[f64; 4]) -> Result<(), InvalidLens> {
    if *fx > 0.0 && *fy > 0.0 { Ok(()) } else { Err(InvalidLens::FocalLength) }
}

/// Refuses the parameter `name` unless it `keeps` the rule that it must keep.
pub(super) fn must(name: &'static str, value: f64, keeps: bool, rule: &'static str) -> Result<(), InvalidLens> {
    if keeps { Ok(()) } else { Err(InvalidLens::OutOfRange { name, value, rule }) }
}
