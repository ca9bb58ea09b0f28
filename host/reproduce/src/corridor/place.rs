//! Where the robot stands, and how long it takes to get there.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Angle, Base, Transform, World};

/// Walking speed in millimetres per second.
pub(super) const SPEED: f64 = 100.0;
/// Turning speed in degrees per second.
const TURNING: f64 = 45.0;
/// Distance from the target at which the robot inspects, in millimetres.
const NEAR: f64 = 420.0;

/// Where the robot stands in the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Millimetres to the right of the corridor's middle.
    pub x: f64,
    /// Millimetres along the corridor.
    pub along: f64,
    /// Turn to the right.
    pub yaw: Angle,
}

impl Place {
    /// In the middle of the corridor, looking along it.
    #[must_use]
    pub fn along(along: f64) -> Self {
        Self { x: 0.0, along, yaw: Angle::from_rad(0.0) }
    }

    /// The pose of the robot's front link.
    #[must_use]
    pub fn world_from_base(&self) -> Transform<World, Base> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.yaw.rad());
        Transform::new(turn, Vector3::new(self.x, 0.0, self.along))
    }

    /// Seconds that the robot walks and turns to another place.
    pub(super) fn seconds_to(&self, to: &Self) -> f64 {
        let way = (to.x - self.x).hypot(to.along - self.along);
        way / SPEED + (to.yaw - self.yaw).deg().abs() / TURNING
    }

    /// The place from which the robot looks straight at a target beside a wall, from near and nearly across the corridor: a parcel that hides
    /// the target along it stays aside.
    pub(super) fn facing([x, z]: [f64; 2]) -> Self {
        let yaw = 1.25_f64.copysign(x);
        Self { x: x - NEAR * yaw.sin(), along: z - NEAR * yaw.cos(), yaw: Angle::from_rad(yaw) }
    }
}
