//! Settings of one axis: range, limits, scales and homing.

use vergence_protocol::{AxisInfo, AxisKind, Micro, SettingItem};

use crate::TICK_US;
use crate::bounds::{self, LONGEST_BRAKING_MS};
use crate::driver::{DriverKind, DriverSettings, StallLimits};
use crate::encoder::EncoderSettings;
use crate::profile::Limits;
use crate::switches::{HomeEnd, SwitchSettings};

/// Encoder counts or motor steps per metre (linear axis) or revolution (rotary axis).
///
/// ```
/// use vergence_control::Scale;
/// use vergence_protocol::{AxisKind, Micro};
///
/// let encoder = Scale { kind: AxisKind::Linear, per_unit: 2_000_000 }; // half a micrometre a count
/// assert_eq!(encoder.counts_at(Micro(1_000)), 2_000);
/// assert_eq!(encoder.position_at(2_000), Micro(1_000));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Whether the axis slides or turns.
    pub kind: AxisKind,
    /// Counts or steps per metre or revolution.
    pub per_unit: u32,
}

impl Scale {
    /// Thousandths of a micro-unit in one unit: 10⁶ µm in a metre, 2π·10⁶ µrad in a revolution.
    pub(crate) const fn milli_micro(self) -> i64 {
        match self.kind {
            AxisKind::Linear => 1_000_000_000,
            AxisKind::Rotary => 6_283_185_307,
        }
    }

    /// The count nearest to `position`.
    // Not inlined, as its counterpart: copies would take kilobytes of flash.
    #[must_use]
    #[inline(never)]
    pub fn counts_at(self, position: Micro) -> i32 {
        let numerator = i128::from(position.0) * i128::from(self.per_unit) * 1000;
        saturate(div_round(numerator, i128::from(self.milli_micro())))
    }

    /// Half the distance between two counts or steps, in 2⁻⁴⁰ micro-units.
    pub(crate) fn half_mark_q40(self) -> i64 {
        // At most half a revolution: below 2²² micro-units.
        ((i128::from(self.milli_micro()) << 40) / (i128::from(self.per_unit.max(1)) * 2000)) as i64
    }

    /// The position nearest to `counts`.
    #[must_use]
    #[inline(never)]
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

/// Settings of the search for the home switch, which is beyond an end of the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomingSettings {
    /// Position at which the switch changes: below `min`, or above `max` where the high end is home. With StallGuard, where the
    /// axis meets its end stop.
    pub switch_at: Micro,
    /// Speed of the search, in micro-units per second.
    pub seek_speed: u32,
    /// Speed of the second approach, whose edge is the reference, in micro-units per second.
    pub approach_speed: u32,
    /// Distance to back off between search and second approach.
    pub retract: Micro,
    /// Largest distance that the search may travel.
    pub travel: Micro,
    /// Largest difference between the edges found by search and second approach.
    pub repeatability: Micro,
}

/// Settings of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisSettings {
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
    /// Motor steps per metre or revolution.
    pub steps_per_unit: u32,
    /// Encoder counts per metre or revolution.
    pub counts_per_unit: u32,
    /// Whether the position rises while the motor's step count falls.
    pub steps_reversed: bool,
    /// Whether the position rises while the encoder's count falls.
    pub counts_reversed: bool,
    /// Largest difference between commanded position and encoder before a fault is raised.
    pub following_error: Micro,
    /// Largest difference between target and encoder at which a move counts as settled.
    pub tolerance: Micro,
    /// Length of the last approach of a move, which always comes from below, so that play is taken up on the same side; 0
    /// for an axis without play.
    pub backlash: Micro,
    /// Largest error at the end of a move that a short second move corrects, as of a screw whose pitch varies; 0 for none.
    /// Steps or counts that were lost are not noticed up to it.
    pub correction: Micro,
    /// Settings of the search for the home switch.
    pub homing: HomingSettings,
    /// Settings of the motor driver.
    pub driver: DriverSettings,
    /// Ends, contacts and StallGuard.
    pub switches: SwitchSettings,
    /// Settings of the encoder.
    pub feedback: EncoderSettings,
}

/// Why settings cannot work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// There are no axes, or more than [`vergence_protocol::MAX_AXES`].
    #[error("a board drives 1 to {} axes", vergence_protocol::MAX_AXES)]
    AxisCount,
    /// A speed, acceleration, jerk, scale, tolerance or distance is not positive.
    #[error("axis {axis}: speeds, accelerations, jerk, scales, tolerances and distances must be positive")]
    NotPositive {
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// `min` is not below `max`, the home switch lies among the positions of a move (backlash included), or the backlash is
    /// negative.
    #[error("axis {axis}: the home switch must lie outside the range, and the range must not be empty")]
    Range {
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// At full speed the motor would make more than [`LARGEST_STEP_RATE`] steps a second.
    #[error("axis {axis}: at full speed the motor would have to make more than {LARGEST_STEP_RATE} steps a second")]
    StepRate {
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// With this value beside the other settings the board could not keep one of its promises.
    #[error("axis {axis}: {name} must lie between {least} and {most}: {why}", name = item.name())]
    Outside {
        /// Index of the axis, from 0.
        axis: usize,
        /// The setting.
        item: SettingItem,
        /// Smallest value that the other settings allow, in the setting's own unit.
        least: i64,
        /// Largest value that the other settings allow, in the setting's own unit.
        most: i64,
        /// Reason for the bounds.
        why: &'static str,
    },
    /// A stop from full speed takes longer than [`LONGEST_BRAKING_MS`].
    #[error(
        "axis {axis}: braking from full speed would take {milliseconds} ms, longer than {LONGEST_BRAKING_MS} ms: \
         raise acceleration or jerk, or lower the speed"
    )]
    Braking {
        /// Index of the axis, from 0.
        axis: usize,
        /// Time to brake from full speed, in milliseconds.
        milliseconds: u32,
    },
    /// The number of microsteps is no power of two up to 256.
    #[error("axis {axis}: microsteps must be a power of two, at most 256")]
    Microsteps {
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// The serial line or the pose stream is too fast or too slow.
    #[error("the serial line or the pose stream cannot have that rate")]
    Link,
    /// Two joints have servos of one number, or joints and stages are mixed.
    #[error("the joints of a robot must have servos of different numbers, and no stages beside them")]
    Joints,
    /// The time until the holding current is too short or too long.
    #[error("the time until the holding current must be 0 or lie between 100 ms and 10 min")]
    Hold,
}

/// Largest number of steps a second of any axis.
pub const LARGEST_STEP_RATE: u32 = 100_000;

impl AxisSettings {
    /// Checks the settings of axis number `axis`.
    ///
    /// # Errors
    /// [`SettingsError`] names the first rule that the settings break.
    pub fn validate(&self, axis: usize) -> Result<(), SettingsError> {
        let rates = [self.speed, self.acceleration, self.jerk, self.steps_per_unit, self.counts_per_unit];
        let homing = &self.homing;
        let distances = [self.following_error, self.tolerance, homing.retract, homing.travel, homing.repeatability];
        let positive = rates.iter().chain(&[homing.seek_speed, homing.approach_speed]).all(|&rate| rate > 0);
        if !positive || distances.iter().any(|distance| distance.0 <= 0) {
            return Err(SettingsError::NotPositive { axis });
        }
        let switch_inside = !self.switch_is_below() && homing.switch_at <= self.max;
        if self.min >= self.max || self.backlash.0 < 0 || switch_inside {
            return Err(SettingsError::Range { axis });
        }
        let fastest = u64::from(self.speed.max(homing.seek_speed).max(homing.approach_speed));
        let steps = u128::from(fastest) * u128::from(self.steps_per_unit) * 1000;
        if steps > u128::from(LARGEST_STEP_RATE) * self.motor().milli_micro() as u128 {
            return Err(SettingsError::StepRate { axis });
        }
        if !(1..=256).contains(&self.driver.microsteps) || !self.driver.microsteps.is_power_of_two() {
            return Err(SettingsError::Microsteps { axis });
        }
        bounds::check(self, axis)
    }

    /// Whether the home switch lies below all positions of a move, backlash included.
    fn switch_is_below(&self) -> bool {
        i64::from(self.homing.switch_at.0) < i64::from(self.min.0) - i64::from(self.backlash.0)
    }

    /// Whether the home switch lies at the end that is home. Settings that differ are no error, because they are changed
    /// one at a time, but nothing homes by them.
    #[must_use]
    pub fn switch_is_at_home(&self) -> bool {
        self.switch_is_below() == (self.switches.home_end == HomeEnd::Low)
    }

    /// The end of the range that is nearest to the home switch.
    #[must_use]
    pub const fn home_position(&self) -> Micro {
        match self.switches.home_end {
            HomeEnd::Low => self.min,
            HomeEnd::High => self.max,
        }
    }

    /// Whether the axis is a joint, which a servo drives and measures.
    #[must_use]
    pub fn is_joint(&self) -> bool {
        self.driver.kind == DriverKind::Servo
    }

    /// The settings for the motor driver, with those of StallGuard.
    #[must_use]
    pub fn driver_settings(&self) -> DriverSettings {
        let stall = if self.switches.stall_guard() { self.stall_limits() } else { None };
        DriverSettings { stall, ..self.driver }
    }

    /// Threshold of a stall, and the TSTEP of the lowest speed at which a driver reports one: three quarters of that of homing.
    fn stall_limits(&self) -> Option<StallLimits> {
        let speed = self.homing.seek_speed.min(self.speed);
        let steps = u64::from(speed) * u64::from(self.steps_per_unit) * 1000 / self.motor().milli_micro() as u64;
        StallLimits::at(steps * 3 / 4, self.driver.microsteps, self.switches.stall_threshold)
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

    /// Counts of the encoder in a second at full speed.
    #[must_use]
    pub fn count_rate(&self) -> u32 {
        let counts =
            u64::from(self.speed) * u64::from(self.counts_per_unit) * 1000 / self.encoder().milli_micro() as u64;
        u32::try_from(counts).unwrap_or(u32::MAX)
    }

    /// The limits of homing at `speed`, but no faster than the axis may move: full acceleration and jerk.
    #[must_use]
    pub fn limits_at(&self, speed: u32) -> Limits {
        Limits { speed: speed.min(self.speed) as f32, ..self.limits() }
    }

    /// Scale of the encoder.
    #[must_use]
    pub const fn encoder(&self) -> Scale {
        Scale { kind: self.kind, per_unit: self.counts_per_unit }
    }

    /// Scale of the motor.
    #[must_use]
    pub const fn motor(&self) -> Scale {
        Scale { kind: self.kind, per_unit: self.steps_per_unit }
    }

    /// Largest change of the encoder in one tick, in micro-units: twice that at full speed, and the distance that a load
    /// springs back when it is let go.
    pub(crate) fn largest_jump(&self) -> u32 {
        let way_of_a_tick = u64::from(self.speed) * TICK_US / 1_000_000;
        let jump = u64::from(self.following_error.0.unsigned_abs() / 2) + 2 * way_of_a_tick;
        u32::try_from(jump).unwrap_or(u32::MAX)
    }

    /// Limits and scale as the host gets them.
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
