//! Axes: a bounded list from the first day on (bench two, robot five).

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::Micro;

/// The most axes a controller may have.
pub const MAX_AXES: usize = 8;

/// One value for each axis, in the order of the axes.
pub type AxisList<T> = Vec<T, MAX_AXES>;

/// A set of axes: bit i is axis i.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct AxisMask(pub u8);

impl AxisMask {
    /// The first `count` axes.
    #[must_use]
    pub const fn first(count: usize) -> Self {
        Self(if count >= MAX_AXES { u8::MAX } else { (1 << count) - 1 })
    }

    /// Whether `axis` is in the set.
    #[must_use]
    pub const fn contains(self, axis: usize) -> bool {
        axis < MAX_AXES && self.0 & (1 << axis) != 0
    }

    /// The set with `axis` in it.
    #[must_use]
    pub const fn with(self, axis: usize) -> Self {
        Self(if axis < MAX_AXES { self.0 | (1 << axis) } else { self.0 })
    }
}

/// Whether an axis slides or turns, which decides what [`Micro`] means on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum AxisKind {
    /// Micrometres.
    Linear,
    /// Microradians.
    Rotary,
}

/// What the board knows of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct AxisInfo {
    /// Linear or rotary.
    pub kind: AxisKind,
    /// Lowest position a move may ask for.
    pub min: Micro,
    /// Highest position a move may ask for.
    pub max: Micro,
    /// Largest speed, micro-units per second.
    pub speed: u32,
    /// Largest acceleration, micro-units per second squared.
    pub acceleration: u32,
    /// Largest jerk, micro-units per second cubed.
    pub jerk: u32,
    /// Encoder counts per metre (linear) or per revolution (rotary) of the axis.
    pub counts_per_unit: u32,
}
