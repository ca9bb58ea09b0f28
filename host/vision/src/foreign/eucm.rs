//! The enhanced unified camera model, and the unified one, which is its case β = 1.
//!
//! B. Khomutenko, G. Garcia, P. Martinet, "An enhanced unified camera model", RA-L 1(1), 2016, eq. 13 and the valid cone of its §III.

use nalgebra::Vector3;

use super::double_sphere::{must, on_plane, plane_shift, positive};
use super::{Formula, ModelParameter, ParameterUnit};
use crate::{InvalidLens, Pixel};

/// The enhanced unified model, of Kalibr (`eucm`) and Basalt (`eucm`, and with β = 1 `ucm`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eucm {
    /// Focal lengths fx, fy and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// Share α of the ellipsoid, 0 to 1.
    pub alpha: f64,
    /// Squared stretch β of the ellipsoid, positive.
    pub beta: f64,
}

impl Formula for Eucm {
    fn name(&self) -> &'static str {
        "enhanced unified"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let own = ModelParameter::named(&["alpha", "beta"], ParameterUnit::One, &[self.alpha, self.beta]);
        [ModelParameter::pinhole(self.pinhole), own].concat()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        positive(&self.pinhole)?;
        must("alpha", self.alpha, (0.0..=1.0).contains(&self.alpha), "lie between 0 and 1")?;
        must("beta", self.beta, self.beta > 0.0, "be positive")
    }

    /// Where z = -w √(β ρ² + z²).
    fn ends(&self) -> f64 {
        let shift = plane_shift(self.alpha);
        let past_side = ((1.0 - shift * shift) / self.beta).sqrt().atan2(shift);
        std::f64::consts::PI - past_side
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let distance = (self.beta * (d.x * d.x + d.y * d.y) + d.z * d.z).sqrt();
        Some(on_plane(self.pinhole, [d.x, d.y], self.alpha * distance + (1.0 - self.alpha) * d.z))
    }
}
