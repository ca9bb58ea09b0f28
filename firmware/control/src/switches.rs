//! What tells an axis where it is: end and kind of its home switch, contacts of its hard limits, and StallGuard in place of
//! a switch.

use crate::TICK_US;

/// The end of the range at which homing seeks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HomeEnd {
    /// Homing goes down; the switch lies below the range.
    #[default]
    Low,
    /// Homing goes up; the switch lies above the range.
    High,
}

impl HomeEnd {
    /// Sign of the motion towards this end.
    #[must_use]
    pub const fn sign(self) -> i32 {
        match self {
            Self::Low => -1,
            Self::High => 1,
        }
    }
}

/// What tells an axis that it is at home.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HomeSensor {
    /// A switch to ground that closes at home. A broken wire looks like a switch that is never found.
    #[default]
    NormallyOpen,
    /// A switch to ground that opens at home. A broken wire looks like a switch that is stuck.
    NormallyClosed,
    /// StallGuard of a TMC2209: its output DIAG is on the line of the switch, high while the driver reports a stall.
    StallGuard,
}

/// Switches of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SwitchSettings {
    /// The end of the range that is home.
    pub home_end: HomeEnd,
    /// What tells that the axis is at home.
    pub home: HomeSensor,
    /// Whether the hard limit switches are normally open. A broken wire then goes unnoticed.
    pub limits_normally_open: bool,
    /// SGTHRS of a TMC2209.
    pub stall_threshold: u32,
    /// Whether a stall that the driver reports in a move is a fault.
    pub stall_watch: bool,
}

impl SwitchSettings {
    /// Whether an axis homes by StallGuard.
    #[must_use]
    pub fn stall_guard(&self) -> bool {
        self.home == HomeSensor::StallGuard
    }

    /// Whether the line of the home switch says that the axis is at home.
    #[must_use]
    pub fn is_home(&self, is_low: bool) -> bool {
        is_low == (self.home == HomeSensor::NormallyOpen)
    }

    /// Whether the line of the hard limit says that it is reached.
    #[must_use]
    pub fn is_limit(&self, is_high: bool) -> bool {
        is_high != self.limits_normally_open
    }
}

/// Time in ticks at constant speed before a report of a stall counts: the load that a motor accelerates looks like a stall.
pub(crate) const STEADY_TICKS: u8 = 10;
/// Readings of DIAG that show a stall: a spike on the wire is one.
const STALL_READINGS: u8 = 2;
/// Readings without stall after which those before are forgotten: a motor that loses its step gives pulses, not a level.
const FORGET_TICKS: u8 = 4;

/// The line DIAG of a motor driver, read once each tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StallLine {
    /// Ticks at constant speed.
    steady: u8,
    high: u8,
    /// Readings without stall since the last one with it.
    low: u8,
}

impl StallLine {
    /// Takes a reading; `is_steady` says whether the axis is commanded to move at constant speed. Returns whether the driver
    /// reports a stall.
    pub fn read(&mut self, is_high: bool, is_steady: bool) -> bool {
        if !is_steady {
            *self = Self::default();
            return false;
        }
        self.steady = self.steady.saturating_add(1);
        if !self.may_be_judged() {
            return false;
        }
        if is_high {
            (self.high, self.low) = (self.high.saturating_add(1), 0);
        } else {
            self.low = self.low.saturating_add(1);
            if self.low >= FORGET_TICKS {
                self.high = 0;
            }
        }
        self.high >= STALL_READINGS
    }

    /// Whether the speed has been constant for so long that StallGuard can be believed.
    pub fn may_be_judged(&self) -> bool {
        self.steady >= STEADY_TICKS
    }
}

/// Way at `speed` in which a stall can be noticed, in micro-units.
pub(crate) fn way_to_judge(speed: f32) -> f32 {
    speed * f32::from(STEADY_TICKS + STALL_READINGS + FORGET_TICKS) * TICK_US as f32 * 1e-6
}
