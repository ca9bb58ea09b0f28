//! The fisheye model with six radial, two tangential and four thin prism coefficients of Project Aria.
//!
//! Project Aria Tools, "Camera intrinsic models", FisheyeRadTanThinPrism. The angle is taken by `atan2`, so that the model goes on past 90°.

use nalgebra::{Vector2, Vector3};

use super::double_sphere::positive;
use super::{AngleLaw, Formula, LensSteps, ModelParameter, OntoPlane, ParameterUnit, Radtan};
use crate::{Asymmetry, InvalidLens, Pixel};

/// FISHEYE624.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fisheye624 {
    /// Focal lengths fx, fy, which are one in the original, and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// Coefficients of θ³ to θ¹³ relative to that of θ.
    pub radial: [f64; 6],
    /// Tangential coefficients p0, p1.
    pub tangential: [f64; 2],
    /// Coefficients s0, s1 along x and s2, s3 along y.
    pub prism: [f64; 4],
}

impl Formula for Fisheye624 {
    fn name(&self) -> &'static str {
        "FISHEYE624"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let names = ["k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"];
        let values = [&self.radial[..], &self.tangential, &self.prism].concat();
        [ModelParameter::pinhole(self.pinhole), ModelParameter::named(&names, ParameterUnit::One, &values)].concat()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        positive(&self.pinhole)
    }

    fn ends(&self) -> f64 {
        std::f64::consts::PI
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let rho = d.x.hypot(d.y);
        let theta = rho.atan2(d.z);
        let squared = theta * theta;
        let series = self.radial.iter().rev().fold(0.0, |sum, k| (sum + k) * squared);
        let scale = if rho > 0.0 { theta * (1.0 + series) / rho } else { 1.0 };
        let displaced = Asymmetry { tangential: self.tangential, prism: self.prism, ..Asymmetry::default() };
        let at = displaced.moved(Vector2::new(scale * d.x, scale * d.y));
        let [fx, fy, cx, cy] = self.pinhole;
        Some(Pixel { u: fx * at.x + cx, v: fy * at.y + cy })
    }

    fn steps(&self) -> Option<LensSteps> {
        Some(LensSteps::new(
            OntoPlane::Angle(AngleLaw::Series(self.radial)),
            Radtan::asymmetric(self.tangential, self.prism),
            self.pinhole,
            0.0,
        ))
    }
}
