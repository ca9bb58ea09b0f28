//! What the controller must know of its axes.

use vergence_protocol::{AxisInfo, AxisKind, Micro};

use crate::TICK_US;
use crate::profile::Limits;

/// Encoder counts or motor steps for each metre (linear) or revolution (rotary) of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Linear or rotary.
    pub kind: AxisKind,
    /// Counts or steps per metre or revolution.
    pub per_unit: u32,
}

impl Scale {
    /// Thousandths of a micro-unit in one unit: 10⁶ µm in a metre, 2π·10⁶ µrad in a revolution.
    const fn milli_micro(self) -> i64 {
        match self.kind {
            AxisKind::Linear => 1_000_000_000,
            AxisKind::Rotary => 6_283_185_307,
        }
    }

    /// The count nearest to `position`.
    #[must_use]
    pub fn counts_at(self, position: Micro) -> i32 {
        let numerator = i128::from(position.0) * i128::from(self.per_unit) * 1000;
        saturate(div_round(numerator, i128::from(self.milli_micro())))
    }

    /// Half the distance between two marks, in 2⁻⁴⁰ micro-units.
    pub(crate) fn half_mark_q40(self) -> i64 {
        // At most half a revolution: below 2²² micro-units.
        ((i128::from(self.milli_micro()) << 40) / (i128::from(self.per_unit.max(1)) * 2000)) as i64
    }

    /// The position nearest to a count.
    #[must_use]
    pub fn position_at(self, counts: i32) -> Micro {
        let numerator = i128::from(counts) * i128::from(self.milli_micro());
        Micro(saturate(div_round(numerator, i128::from(self.per_unit.max(1)) * 1000)))
    }
}

fn div_round(numerator: i128, denominator: i128) -> i128 {
    (numerator + denominator.signum() * numerator.signum() * denominator / 2) / denominator
}

fn saturate(value: i128) -> i32 {
    i32::try_from(value).unwrap_or(if value < 0 { i32::MIN } else { i32::MAX })
}

/// How an axis finds its reference: a switch beyond the low end of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomingSettings {
    /// Where the switch closes, in axis coordinates; below `min`.
    pub switch_at: Micro,
    /// Speed of the search, micro-units per second.
    pub seek_speed: u32,
    /// Speed of the second approach, whose edge is the reference.
    pub approach_speed: u32,
    /// How far to back off between the two.
    pub retract: Micro,
    /// Largest way of the search.
    pub travel: Micro,
    /// Largest difference between the two edges.
    pub repeatability: Micro,
}

/// One axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisSettings {
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
    /// Motor steps per metre or revolution.
    pub steps_per_unit: u32,
    /// Encoder counts per metre or revolution.
    pub counts_per_unit: u32,
    /// Whether the motor turns the other way round.
    pub steps_reversed: bool,
    /// Whether the encoder counts the other way round.
    pub counts_reversed: bool,
    /// Largest difference between command and encoder while moving.
    pub following_error: Micro,
    /// Largest difference between target and encoder at which a move counts as reached.
    pub tolerance: Micro,
    /// How far the last approach of a move comes from below, so that play is always taken up on the same side; 0 where
    /// there is none.
    pub backlash: Micro,
    /// Homing.
    pub homing: HomingSettings,
}

/// Settings that no axis can work with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SettingsError {
    /// There are no axes, or more than [`vergence_protocol::MAX_AXES`].
    AxisCount,
    /// A speed, acceleration, jerk, scale, tolerance or distance is not positive.
    NotPositive {
        /// Which axis.
        axis: usize,
    },
    /// `min` is not below `max`, or the switch does not lie below all that a move may touch, or the play is negative.
    Range {
        /// Which axis.
        axis: usize,
    },
    /// At full speed the motor would have to make more than [`LARGEST_STEP_RATE`] steps a second.
    StepRate {
        /// Which axis.
        axis: usize,
    },
    /// The serial line or the pose stream cannot be that fast or slow.
    Link,
}

/// The most steps a second that any axis may need.
pub const LARGEST_STEP_RATE: u32 = 100_000;

impl AxisSettings {
    /// Checks one axis.
    ///
    /// # Errors
    /// Says what cannot be.
    pub fn validate(&self, axis: usize) -> Result<(), SettingsError> {
        let rates = [self.speed, self.acceleration, self.jerk, self.steps_per_unit, self.counts_per_unit];
        let homing = &self.homing;
        let distances = [self.following_error, self.tolerance, homing.retract, homing.travel, homing.repeatability];
        let positive = rates.iter().chain(&[homing.seek_speed, homing.approach_speed]).all(|&rate| rate > 0);
        if !positive || distances.iter().any(|distance| distance.0 <= 0) {
            return Err(SettingsError::NotPositive { axis });
        }
        let lowest = i64::from(self.min.0) - i64::from(self.backlash.0);
        if self.min >= self.max || self.backlash.0 < 0 || i64::from(homing.switch_at.0) >= lowest {
            return Err(SettingsError::Range { axis });
        }
        let fastest = u64::from(self.speed.max(homing.seek_speed).max(homing.approach_speed));
        let steps = u128::from(fastest) * u128::from(self.steps_per_unit) * 1000;
        if steps > u128::from(LARGEST_STEP_RATE) * self.motor().milli_micro() as u128 {
            return Err(SettingsError::StepRate { axis });
        }
        Ok(())
    }

    /// Whether a move may ask for `position`.
    #[must_use]
    pub fn allows(&self, position: Micro) -> bool {
        (self.min..=self.max).contains(&position)
    }

    /// The limits of full-speed motion.
    #[must_use]
    pub fn limits(&self) -> Limits {
        Limits { speed: self.speed as f32, acceleration: self.acceleration as f32, jerk: self.jerk as f32 }
    }

    /// The limits of homing at `speed`: full acceleration and jerk.
    #[must_use]
    pub fn limits_at(&self, speed: u32) -> Limits {
        Limits { speed: speed as f32, ..self.limits() }
    }

    /// The encoder.
    #[must_use]
    pub const fn encoder(&self) -> Scale {
        Scale { kind: self.kind, per_unit: self.counts_per_unit }
    }

    /// The motor.
    #[must_use]
    pub const fn motor(&self) -> Scale {
        Scale { kind: self.kind, per_unit: self.steps_per_unit }
    }

    /// How far the encoder may go in one tick: twice as far as at full speed, and what a load that was held springs back.
    pub(crate) fn largest_jump(&self) -> u32 {
        let way_of_a_tick = u64::from(self.speed) * TICK_US / 1_000_000;
        let jump = u64::from(self.following_error.0.unsigned_abs() / 2) + 2 * way_of_a_tick;
        u32::try_from(jump).unwrap_or(u32::MAX)
    }

    /// What the host is told.
    #[must_use]
    pub const fn info(&self) -> AxisInfo {
        AxisInfo {
            kind: self.kind,
            min: self.min,
            max: self.max,
            speed: self.speed,
            acceleration: self.acceleration,
            jerk: self.jerk,
            counts_per_unit: self.counts_per_unit,
        }
    }
}
