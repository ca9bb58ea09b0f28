//! The encoder of an axis: what kind it is, and how its count is checked.

use crate::settings::AxisSettings;

/// Counts of an AS5048A in one turn: 14 bits.
pub const TURN: u32 = 1 << 14;
/// Counts of a servo in one turn: 12 bits.
const SERVO_TURN: u32 = 1 << 12;
/// Number of axes whose encoder may be absolute: their first ones, by the lines that boards have.
pub(crate) const ABSOLUTE_AXES: usize = 2;
/// Least drift in counts that an index pulse finds: encoders at rest flicker, and the pulse is read some microseconds late.
const LEAST_DRIFT: i32 = 4;

/// Kind of encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderKind {
    /// Two lines in quadrature.
    #[default]
    Quadrature,
    /// An AS5048A of ams OSRAM: 14 bits, by SPI.
    As5048a,
    /// That of a servo of the X series: 12 bits, by its bus.
    Servo,
}

/// Settings of an encoder, apart from its counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderSettings {
    /// Kind of encoder.
    pub kind: EncoderKind,
    /// Counts from one index pulse to the next; 0 for an encoder without index.
    pub index_every: u32,
    /// Reading of an absolute encoder at the axis zero, below [`Self::turn`].
    pub zero: u32,
}

impl EncoderSettings {
    /// Whether the encoder knows its angle without homing.
    #[must_use]
    pub fn is_absolute(&self) -> bool {
        self.kind != EncoderKind::Quadrature
    }

    /// Counts of an absolute encoder in one turn.
    #[must_use]
    pub fn turn(&self) -> u32 {
        if self.kind == EncoderKind::Servo { SERVO_TURN } else { TURN }
    }
}

impl AxisSettings {
    /// Largest drift at an index pulse, in counts, that is no fault: half of the tolerance.
    // Not inlined: it divides 128 bits.
    #[inline(never)]
    #[must_use]
    pub fn largest_drift(&self) -> i32 {
        (self.encoder().counts_at(self.tolerance) / 2).max(LEAST_DRIFT)
    }
}
