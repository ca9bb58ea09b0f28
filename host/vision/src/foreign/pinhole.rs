//! The pinhole with OpenCV's distortion: radial, tangential, rational, thin prism and tilted sensor.
//!
//! OpenCV, module calib3d, "Detailed description"; D. C. Brown, "Close-range camera calibration", 1971.

use nalgebra::{Matrix3, Vector3};

use super::double_sphere::positive;
use super::{Formula, LensSteps, ModelParameter, OntoPlane, ParameterUnit};
use crate::{InvalidLens, Pixel};

/// Distortion on the plane z = 1, with the coefficients of OpenCV in its order:
/// k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 τx τy. The first 4, 5, 8, 12 or 14 are given, the others are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radtan {
    pub(crate) coefficients: [f64; 14],
    /// What the tilt of the sensor does to the plane.
    pub(crate) tilt: Matrix3<f64>,
}

pub(super) const NAMES: [&str; 14] =
    ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"];

impl Radtan {
    /// The distortion with the first `coefficients`, of which OpenCV knows 4, 5, 8, 12 and 14, and none. `None` for another number.
    #[must_use]
    pub fn new(coefficients: &[f64]) -> Option<Self> {
        if ![0, 4, 5, 8, 12, 14].contains(&coefficients.len()) {
            return None;
        }
        let mut all = [0.0; 14];
        for (place, value) in all.iter_mut().zip(coefficients) {
            *place = *value;
        }
        let [.., tau_x, tau_y] = all;
        Some(Self { coefficients: all, tilt: tilt(tau_x, tau_y) })
    }

    /// The displacement of [`crate::Asymmetry`] alone, with its tangential and prism terms.
    pub(super) fn asymmetric([p0, p1]: [f64; 2], [s1, s2, s3, s4]: [f64; 4]) -> Self {
        Self { coefficients: [0.0, 0.0, p1, p0, 0.0, 0.0, 0.0, 0.0, s1, s2, s3, s4, 0.0, 0.0], ..Self::default() }
    }

    /// The coefficients up to the last that is not zero, and k1 k2 p1 p2 always.
    #[must_use]
    pub fn parameters(&self) -> Vec<ModelParameter> {
        let used = self.coefficients.iter().rposition(|value| *value != 0.0).map_or(4, |last| last + 1).max(4);
        ModelParameter::named(&NAMES[..used], ParameterUnit::One, &self.coefficients[..used])
    }

    /// Where the point (x, y) of the plane goes.
    #[must_use]
    pub fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y] = self.coefficients;
        let r2 = x * x + y * y;
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let [x, y] = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
        ];
        if tau_x == 0.0 && tau_y == 0.0 {
            return [x, y];
        }
        let tilted = self.tilt * Vector3::new(x, y, 1.0);
        [tilted.x / tilted.z, tilted.y / tilted.z]
    }
}

impl Default for Radtan {
    /// No distortion.
    fn default() -> Self {
        Self { coefficients: [0.0; 14], tilt: Matrix3::identity() }
    }
}

/// The projection from a plane across the axis to one that is turned by τx about x and then by τy about y.
fn tilt(tau_x: f64, tau_y: f64) -> Matrix3<f64> {
    let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, tau_x.cos(), tau_x.sin(), 0.0, -tau_x.sin(), tau_x.cos());
    let about_y = Matrix3::new(tau_y.cos(), 0.0, -tau_y.sin(), 0.0, 1.0, 0.0, tau_y.sin(), 0.0, tau_y.cos());
    let turn = about_y * about_x;
    let along = Matrix3::new(turn[(2, 2)], 0.0, -turn[(0, 2)], 0.0, turn[(2, 2)], -turn[(1, 2)], 0.0, 0.0, 1.0);
    along * turn
}

/// A pinhole camera with distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal lengths fx, fy and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// Distortion on the plane.
    pub distortion: Radtan,
}

impl Formula for Pinhole {
    fn name(&self) -> &'static str {
        "pinhole"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        [ModelParameter::pinhole(self.pinhole), self.distortion.parameters()].concat()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        positive(&self.pinhole)
    }

    fn ends(&self) -> f64 {
        std::f64::consts::FRAC_PI_2
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let [x, y] = self.distortion.distorted([d.x / d.z, d.y / d.z]);
        let [fx, fy, cx, cy] = self.pinhole;
        Some(Pixel { u: fx * x + cx, v: fy * y + cy })
    }

    fn steps(&self) -> Option<LensSteps> {
        Some(LensSteps::new(OntoPlane::Sphere(0.0), self.distortion, self.pinhole, 0.0))
    }
}
