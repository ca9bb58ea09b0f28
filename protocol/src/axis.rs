//! Axes: lists and sets of them, and what the board says of each. The bench has two axes, the robot five.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::Micro;

/// Largest number of axes of one controller.
pub const MAX_AXES: usize = 8;

/// One value for each axis, in the order of the axes.
pub type AxisList<T> = Vec<T, MAX_AXES>;

/// A set of axes: bit i stands for axis i.
///
/// ```
/// use vergence_protocol::AxisMask;
///
/// assert_eq!(AxisMask::first(2), AxisMask(0b11));
/// assert!(AxisMask::default().with(3).contains(3));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct AxisMask(pub u8);

impl AxisMask {
    /// The set of axes 0 to `count` - 1.
    #[must_use]
    pub const fn first(count: usize) -> Self {
        Self(if count >= MAX_AXES { u8::MAX } else { (1 << count) - 1 })
    }

    /// Whether `axis` is in the set; false for an axis beyond [`MAX_AXES`].
    #[must_use]
    pub const fn contains(self, axis: usize) -> bool {
        axis < MAX_AXES && self.0 & (1 << axis) != 0
    }

    /// The set with `axis` added; unchanged for an axis beyond [`MAX_AXES`].
    #[must_use]
    pub const fn with(self, axis: usize) -> Self {
        Self(if axis < MAX_AXES { self.0 | (1 << axis) } else { self.0 })
    }
}

/// Whether an axis slides or turns: decides the unit of [`Micro`] on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum AxisKind {
    /// The axis slides; positions are in micrometres.
    Linear,
    /// The axis turns; positions are in microradians.
    Rotary,
}

/// Limits and scale of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct AxisInfo {
    /// Whether the axis slides or turns.
    pub kind: AxisKind,
    /// Lowest position a move may ask for.
    pub min: Micro,
    /// Highest position a move may ask for.
    pub max: Micro,
    /// Largest speed, in micro-units per second.
    pub speed: u32,
    /// Largest acceleration, in micro-units per second squared.
    pub acceleration: u32,
    /// Largest jerk, in micro-units per second cubed.
    pub jerk: u32,
    /// Encoder counts per metre (linear axis) or per revolution (rotary axis).
    pub counts_per_unit: u32,
}
