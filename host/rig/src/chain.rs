//! Screw chains: the pose of a camera as a function of the axis positions.
//!
//! Product of exponentials, R. Brockett 1984; K. Lynch and F. Park, *Modern Robotics*, 2017, §4.1.1:
//! `base_from_camera(q) = exp(ξ₁ s₁ q₁) exp(ξ₂ s₂ q₂) ... M`, with the screws ξ in the base frame when all axes are at
//! zero.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use vergence_vision::{Base, Frame, Point, Transform};

/// A unit screw: a translation or a rotation, in the base frame with all axes at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Screw {
    /// Translation along a direction, by an amount in millimetres.
    Slide {
        /// Direction of the translation.
        along: Unit<Vector3<f64>>,
    },
    /// Rotation about a line, by an amount in radians.
    Turn {
        /// Direction of the line; right-handed.
        about: Unit<Vector3<f64>>,
        /// A point on the line.
        through: Point<Base>,
    },
}

/// A screw with the axis that drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Index of the axis in the rig.
    pub axis: usize,
    /// Factor from the axis position to the amount of motion.
    pub share: f64,
    /// The screw, with all axes at zero.
    pub screw: Screw,
}

/// The screws from the base to a camera, and the camera's pose with all axes at zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<C: Frame> {
    pub(crate) links: Vec<Link>,
    pub(crate) at_zero: Transform<Base, C>,
}

impl Screw {
    /// The motion by `amount` in millimetres or radians.
    #[must_use]
    pub fn displacement(&self, amount: f64) -> Isometry3<f64> {
        match self {
            Self::Slide { along } => Translation3::from(along.into_inner() * amount).into(),
            Self::Turn { about, through } => {
                let rotation = UnitQuaternion::from_axis_angle(about, amount);
                let pivot = through.mm();
                Isometry3::from_parts(Translation3::from(pivot - rotation * pivot), rotation)
            }
        }
    }
}

impl<C: Frame> Chain<C> {
    /// Makes a chain from its links, in the order base to camera, and the camera's pose with all axes at zero.
    #[must_use]
    pub const fn new(links: Vec<Link>, at_zero: Transform<Base, C>) -> Self {
        Self { links, at_zero }
    }

    /// The links, in the order base to camera.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// The camera's pose with all axes at zero.
    #[must_use]
    pub const fn at_zero(&self) -> Transform<Base, C> {
        self.at_zero
    }

    /// The camera's pose with the axes at `values` (millimetres or radians each). Axes without a value are at zero.
    #[must_use]
    pub fn base_from_camera(&self, values: &[f64]) -> Transform<Base, C> {
        let moved = self.links.iter().fold(Isometry3::identity(), |pose, link| {
            pose * link.screw.displacement(link.share * values.get(link.axis).copied().unwrap_or(0.0))
        });
        Transform::from_isometry(moved * self.at_zero.isometry())
    }
}
