//! The entrance pupil of a lens, which moves along the axis with the angle of the light.

use vergence_vision::{Angle, Camera, Point, UnitRay};

/// How far the entrance pupil of a lens moves forward, by D. Gennery, "Generalized camera calibration including fish-eye
/// lenses", IJCV 68(3), 2006: e(θ) = (θ / sin θ - 1) e0. The default stands still, as in every model with one centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EntrancePupil {
    /// The factor e0, in millimetres. Wide lenses have about twice their focal length.
    pub e0_mm: f64,
}

impl EntrancePupil {
    /// How far before the camera's origin light at `theta` from the axis crosses the axis, in millimetres.
    #[must_use]
    pub fn shift_mm(&self, theta: Angle) -> f64 {
        let theta = theta.rad();
        // Below this angle the quotient loses digits; its series is exact to 1e-13.
        let over_sine = if theta.abs() < 1e-3 { 1.0 + theta * theta / 6.0 } else { theta / theta.sin() };
        (over_sine - 1.0) * self.e0_mm
    }

    /// The direction in which light from `point` enters the lens. `None` for a point at the pupil.
    #[must_use]
    pub fn direction(&self, point: &Point<Camera>) -> Option<UnitRay<Camera>> {
        // A step changes θ by e'(θ) sin θ / range of the last: by less than a tenth from 50 mm on.
        const STEPS: usize = 16;
        let mut seen = point.mm();
        if self.e0_mm != 0.0 {
            for _ in 0..STEPS {
                let theta = Angle::from_rad(seen.xy().norm().atan2(seen.z));
                seen.z = point.mm().z - self.shift_mm(theta);
            }
        }
        UnitRay::new(seen)
    }
}
