//! The omnidirectional model of OpenCV's `cv::omnidir` and of Kalibr's `omni`.
//!
//! C. Mei and P. Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007: a point goes to the unit sphere,
//! from there to a plane by a pinhole at the distance ξ behind the sphere's centre; there the distortion of [`Radtan`] acts.

use nalgebra::Vector3;

use super::double_sphere::{must, positive};
use super::pinhole::Radtan;
use super::{Formula, LensSteps, ModelParameter, OntoPlane, ParameterUnit};
use crate::{InvalidLens, Pixel};

/// The model of Mei.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mei {
    /// Focal lengths fx, fy and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// Skew in pixels: what a step along y moves along u.
    pub skew: f64,
    /// Distance ξ of the pinhole behind the centre of the sphere, not negative.
    pub xi: f64,
    /// Distortion on the plane.
    pub distortion: Radtan,
}

impl Formula for Mei {
    fn name(&self) -> &'static str {
        "omnidirectional (Mei)"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let own = vec![
            ModelParameter::new("skew", ParameterUnit::Pixels, self.skew),
            ModelParameter::new("xi", ParameterUnit::One, self.xi),
        ];
        [ModelParameter::pinhole(self.pinhole), own, self.distortion.parameters()].concat()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        positive(&self.pinhole)?;
        must("xi", self.xi, self.xi >= 0.0, "not be negative")
    }

    /// Where the plane is reached no more, or where rays meet it a second time.
    fn ends(&self) -> f64 {
        let shift = if self.xi > 1.0 { 1.0 / self.xi } else { self.xi };
        (-shift).acos()
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let depth = d.z + self.xi * d.norm();
        let [x, y] = self.distortion.distorted([d.x / depth, d.y / depth]);
        let [fx, fy, cx, cy] = self.pinhole;
        Some(Pixel { u: fx * x + self.skew * y + cx, v: fy * y + cy })
    }

    fn steps(&self) -> Option<LensSteps> {
        Some(LensSteps::new(OntoPlane::Sphere(self.xi), self.distortion, self.pinhole, self.skew))
    }
}
