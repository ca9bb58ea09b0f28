//! The settings of an axis, each readable as one number.

use vergence_protocol::{AxisKind, Micro, SettingItem};

use crate::board_settings::SettingError;
use crate::driver::{DriverKind, DriverSettings};
use crate::encoder::{EncoderKind, EncoderSettings};
use crate::settings::{AxisSettings, HomingSettings};
use crate::switches::{HomeEnd, HomeSensor, SwitchSettings};

impl AxisSettings {
    /// Settings of an axis of this kind that are all zero, but for a plain motor driver.
    pub(crate) fn blank(kind: AxisKind) -> Self {
        let nothing = Micro(0);
        let homing = HomingSettings {
            switch_at: nothing,
            seek_speed: 0,
            approach_speed: 0,
            retract: nothing,
            travel: nothing,
            repeatability: nothing,
        };
        Self {
            kind,
            min: nothing,
            max: nothing,
            speed: 0,
            acceleration: 0,
            jerk: 0,
            steps_per_unit: 0,
            counts_per_unit: 0,
            steps_reversed: false,
            counts_reversed: false,
            following_error: nothing,
            tolerance: nothing,
            backlash: nothing,
            correction: nothing,
            homing,
            driver: DriverSettings::default(),
            switches: SwitchSettings::default(),
            feedback: EncoderSettings::default(),
        }
    }

    /// Value of an axis setting; `None` for settings of the board.
    pub(crate) fn item(&self, item: SettingItem) -> Option<i64> {
        let (homing, driver, switches, encoder) = (&self.homing, &self.driver, &self.switches, &self.feedback);
        Some(match item {
            SettingItem::Min => self.min.0.into(),
            SettingItem::Max => self.max.0.into(),
            SettingItem::Speed => self.speed.into(),
            SettingItem::Acceleration => self.acceleration.into(),
            SettingItem::Jerk => self.jerk.into(),
            SettingItem::StepsPerUnit => self.steps_per_unit.into(),
            SettingItem::CountsPerUnit => self.counts_per_unit.into(),
            SettingItem::StepsReversed => self.steps_reversed.into(),
            SettingItem::CountsReversed => self.counts_reversed.into(),
            SettingItem::FollowingError => self.following_error.0.into(),
            SettingItem::Tolerance => self.tolerance.0.into(),
            SettingItem::Backlash => self.backlash.0.into(),
            SettingItem::HomeSwitchAt => homing.switch_at.0.into(),
            SettingItem::HomeSeekSpeed => homing.seek_speed.into(),
            SettingItem::HomeApproachSpeed => homing.approach_speed.into(),
            SettingItem::HomeRetract => homing.retract.0.into(),
            SettingItem::HomeTravel => homing.travel.0.into(),
            SettingItem::HomeRepeatability => homing.repeatability.0.into(),
            SettingItem::Driver => driver.kind as i64,
            SettingItem::SenseResistor => driver.sense_mohm.into(),
            SettingItem::RunCurrent => driver.run_ma.into(),
            SettingItem::HoldCurrent => driver.hold_ma.into(),
            SettingItem::HoldDelay => driver.hold_delay_us.into(),
            SettingItem::Microsteps => driver.microsteps.into(),
            SettingItem::StealthChop => driver.stealth_chop.into(),
            SettingItem::Correction => self.correction.0.into(),
            SettingItem::HomeEnd => (switches.home_end == HomeEnd::High).into(),
            SettingItem::HomeSwitch => switches.home as i64,
            SettingItem::HardLimit => switches.limits_normally_open.into(),
            SettingItem::StallThreshold => switches.stall_threshold.into(),
            SettingItem::StallWatch => switches.stall_watch.into(),
            SettingItem::IndexEvery => encoder.index_every.into(),
            SettingItem::Encoder => encoder.kind as i64,
            SettingItem::EncoderZero => encoder.zero.into(),
            SettingItem::ServoId => driver.servo_id.into(),
            _ => return None,
        })
    }

    pub(crate) fn put(&mut self, item: SettingItem, value: i64) -> Result<(), SettingError> {
        let (homing, driver) = (&mut self.homing, &mut self.driver);
        let (switches, encoder) = (&mut self.switches, &mut self.feedback);
        match item {
            SettingItem::Min => self.min = micro(value)?,
            SettingItem::Max => self.max = micro(value)?,
            SettingItem::Speed => self.speed = number(value)?,
            SettingItem::Acceleration => self.acceleration = number(value)?,
            SettingItem::Jerk => self.jerk = number(value)?,
            SettingItem::StepsPerUnit => self.steps_per_unit = number(value)?,
            SettingItem::CountsPerUnit => self.counts_per_unit = number(value)?,
            SettingItem::StepsReversed => self.steps_reversed = flag(value)?,
            SettingItem::CountsReversed => self.counts_reversed = flag(value)?,
            SettingItem::FollowingError => self.following_error = micro(value)?,
            SettingItem::Tolerance => self.tolerance = micro(value)?,
            SettingItem::Backlash => self.backlash = micro(value)?,
            SettingItem::HomeSwitchAt => homing.switch_at = micro(value)?,
            SettingItem::HomeSeekSpeed => homing.seek_speed = number(value)?,
            SettingItem::HomeApproachSpeed => homing.approach_speed = number(value)?,
            SettingItem::HomeRetract => homing.retract = micro(value)?,
            SettingItem::HomeTravel => homing.travel = micro(value)?,
            SettingItem::HomeRepeatability => homing.repeatability = micro(value)?,
            SettingItem::Driver => driver.kind = driver_kind(value)?,
            SettingItem::SenseResistor => driver.sense_mohm = number(value)?,
            SettingItem::RunCurrent => driver.run_ma = number(value)?,
            SettingItem::HoldCurrent => driver.hold_ma = number(value)?,
            SettingItem::HoldDelay => driver.hold_delay_us = number(value)?,
            SettingItem::Microsteps => driver.microsteps = number(value)?,
            SettingItem::StealthChop => driver.stealth_chop = flag(value)?,
            SettingItem::Correction => self.correction = micro(value)?,
            SettingItem::HomeEnd => switches.home_end = if flag(value)? { HomeEnd::High } else { HomeEnd::Low },
            SettingItem::HomeSwitch => switches.home = sensor(value)?,
            SettingItem::HardLimit => switches.limits_normally_open = flag(value)?,
            SettingItem::StallThreshold => switches.stall_threshold = number(value)?,
            SettingItem::StallWatch => switches.stall_watch = flag(value)?,
            SettingItem::IndexEvery => encoder.index_every = number(value)?,
            SettingItem::Encoder => encoder.kind = encoder_kind(value)?,
            SettingItem::EncoderZero => encoder.zero = number(value)?,
            SettingItem::ServoId => driver.servo_id = number(value)?,
            _ => return Err(SettingError::Unknown),
        }
        Ok(())
    }

    /// Whether a reference found with the settings `self` is still valid with `other`.
    pub(crate) fn keeps_reference(&self, other: &Self) -> bool {
        let scale = |axis: &Self| (axis.kind, axis.counts_per_unit, axis.counts_reversed);
        let home = |axis: &Self| (axis.homing.switch_at, axis.switches.home_end, axis.switches.home);
        // The range of an absolute encoder tells which of its turns is meant.
        let range = |axis: &Self| axis.feedback.is_absolute().then_some((axis.min, axis.max));
        let encoder = |axis: &Self| (axis.feedback, range(axis));
        scale(self) == scale(other) && home(self) == home(other) && encoder(self) == encoder(other)
    }
}

fn micro(value: i64) -> Result<Micro, SettingError> {
    i32::try_from(value).map(Micro).map_err(|_| SettingError::Value)
}

pub(crate) fn number(value: i64) -> Result<u32, SettingError> {
    u32::try_from(value).map_err(|_| SettingError::Value)
}

fn driver_kind(value: i64) -> Result<DriverKind, SettingError> {
    let kinds = [DriverKind::Plain, DriverKind::Tmc2209, DriverKind::Servo];
    kinds.into_iter().find(|&kind| kind as i64 == value).ok_or(SettingError::Value)
}

fn encoder_kind(value: i64) -> Result<EncoderKind, SettingError> {
    let kinds = [EncoderKind::Quadrature, EncoderKind::As5048a, EncoderKind::Servo];
    kinds.into_iter().find(|&kind| kind as i64 == value).ok_or(SettingError::Value)
}

fn sensor(value: i64) -> Result<HomeSensor, SettingError> {
    match value {
        0 => Ok(HomeSensor::NormallyOpen),
        1 => Ok(HomeSensor::NormallyClosed),
        2 => Ok(HomeSensor::StallGuard),
        _ => Err(SettingError::Value),
    }
}

pub(crate) fn flag(value: i64) -> Result<bool, SettingError> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(SettingError::Value),
    }
}
