//! The settings of a board: all axes, pose stream, serial line, machine and holding current, each readable as one number.

use vergence_protocol::{AxisKind, AxisList, Micro, SettingItem, SettingKey};

use crate::driver::{DriverKind, DriverSettings};
use crate::encoder::{EncoderKind, EncoderSettings};
use crate::settings::{AxisSettings, HomingSettings, SettingsError};
use crate::switches::{HomeEnd, HomeSensor, SwitchSettings};

/// Shortest period of the pose stream in microseconds: a pose of 45 bytes at 921 600 baud takes half of it.
pub const SHORTEST_STREAM_US: u32 = 1_000;
/// Longest period of the pose stream in microseconds.
const LONGEST_STREAM_US: u32 = 10_000_000;
/// Default period of the pose stream in microseconds: leaves room for answers and log at 921 600 baud.
const STREAM_US: u32 = 2_000;
/// Speeds that serial ports and USB bridges can have.
const BAUD: core::ops::RangeInclusive<u32> = 9_600..=12_000_000;
/// Default speed of the serial line: the fastest that the USB bridges of most boards take.
const USUAL_BAUD: u32 = 921_600;

/// Default time in microseconds until the holding current: a pause between two moves is shorter.
const HOLD_AFTER_US: u32 = 5_000_000;
/// Bounds of that time in microseconds: a stage has settled after the shortest, and the longest keeps no motor warm for hours.
const HOLD_AFTER: core::ops::RangeInclusive<u32> = 100_000..=600_000_000;

/// The machine that a board drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Machine {
    /// The stages of the bench.
    #[default]
    Bench,
    /// The joints of the robot, on its servo bus. No firmware drives them yet.
    Robot,
}

/// All settings of a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSettings {
    /// Settings of each axis.
    pub axes: AxisList<AxisSettings>,
    /// Period of the pose stream when a session opens, in microseconds; 0 for no stream.
    pub stream_period_us: u32,
    /// Speed of the serial line in baud: on trial until a host is heard at it, and the speed at a start.
    pub baud: u32,
    /// The machine that the board drives.
    pub machine: Machine,
    /// Time in microseconds at rest after which the motors get their holding current; 0 for never.
    pub hold_after_us: u32,
}

/// Why a setting was not changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// The board has no such setting.
    #[error("there is no such setting")]
    Unknown,
    /// The setting cannot have this value, at all or beside the other settings.
    #[error("the setting cannot have this value")]
    Value,
}

impl BoardSettings {
    /// Settings with these axes and the default stream, line speed and machine.
    ///
    /// # Errors
    /// [`SettingsError`] if an axis cannot work with its settings.
    pub fn new(axes: &[AxisSettings]) -> Result<Self, SettingsError> {
        let axes = axes.iter().copied().collect::<heapless::Vec<_, { vergence_protocol::MAX_AXES }>>();
        let settings = Self::delivered(axes);
        settings.validate()?;
        Ok(settings)
    }

    /// These axes, and everything else as delivered.
    fn delivered(axes: AxisList<AxisSettings>) -> Self {
        Self {
            axes,
            stream_period_us: STREAM_US,
            baud: USUAL_BAUD,
            machine: Machine::Bench,
            hold_after_us: HOLD_AFTER_US,
        }
    }

    /// Settings of a board whose axes are of these `kinds`, with the `values` given; others are zero, and those of motor
    /// drivers as delivered. They are not checked: see [`Self::validate`].
    ///
    /// # Errors
    /// [`SettingError`] if a value names no setting of such a board, or does not fit its number.
    pub fn from_values(
        kinds: &[AxisKind],
        values: impl IntoIterator<Item = (SettingKey, i64)>,
    ) -> Result<Self, SettingError> {
        let axes = kinds.iter().take(vergence_protocol::MAX_AXES).map(|&kind| AxisSettings::blank(kind)).collect();
        let mut settings = Self::delivered(axes);
        values.into_iter().try_for_each(|(key, value)| settings.put(key, value))?;
        Ok(settings)
    }

    /// Checks all settings.
    ///
    /// # Errors
    /// [`SettingsError`] names the first setting that cannot work.
    pub fn validate(&self) -> Result<(), SettingsError> {
        if self.axes.is_empty() {
            return Err(SettingsError::AxisCount);
        }
        for (index, axis) in self.axes.iter().enumerate() {
            axis.validate(index)?;
        }
        let stream =
            self.stream_period_us == 0 || (SHORTEST_STREAM_US..=LONGEST_STREAM_US).contains(&self.stream_period_us);
        if !stream || !BAUD.contains(&self.baud) {
            return Err(SettingsError::Link);
        }
        if self.hold_after_us == 0 || HOLD_AFTER.contains(&self.hold_after_us) {
            Ok(())
        } else {
            Err(SettingsError::Hold)
        }
    }

    /// The keys of all settings of this board.
    pub fn keys(&self) -> impl Iterator<Item = SettingKey> + use<> {
        let axes = self.axes.len();
        SettingItem::ALL.into_iter().flat_map(move |item| {
            let count = if item.is_of_axis() { axes } else { 1 };
            (0..=u8::MAX).take(count).map(move |axis| SettingKey { item, axis })
        })
    }

    /// Value of a setting; `None` if the board has no such setting.
    #[must_use]
    pub fn get(&self, key: SettingKey) -> Option<i64> {
        match key {
            SettingKey { item: SettingItem::StreamPeriod, axis: 0 } => Some(self.stream_period_us.into()),
            SettingKey { item: SettingItem::Baud, axis: 0 } => Some(self.baud.into()),
            SettingKey { item: SettingItem::Machine, axis: 0 } => Some((self.machine == Machine::Robot).into()),
            SettingKey { item: SettingItem::HoldAfter, axis: 0 } => Some(self.hold_after_us.into()),
            SettingKey { item, axis } => self.axes.get(usize::from(axis))?.item(item),
        }
    }

    /// A copy of these settings with one changed.
    ///
    /// # Errors
    /// [`SettingError`] if there is no such setting or the changed settings could not work.
    pub fn with(&self, key: SettingKey, value: i64) -> Result<Self, SettingError> {
        let mut changed = self.clone();
        changed.put(key, value)?;
        changed.validate().map_err(|_| SettingError::Value)?;
        Ok(changed)
    }

    /// Changes one setting without checking the others.
    pub(crate) fn put(&mut self, key: SettingKey, value: i64) -> Result<(), SettingError> {
        self.get(key).ok_or(SettingError::Unknown)?;
        match key.item {
            SettingItem::StreamPeriod => self.stream_period_us = number(value)?,
            SettingItem::Baud => self.baud = number(value)?,
            SettingItem::HoldAfter => self.hold_after_us = number(value)?,
            SettingItem::Machine => self.machine = if flag(value)? { Machine::Robot } else { Machine::Bench },
            item => {
                let axis = self.axes.get_mut(usize::from(key.axis)).ok_or(SettingError::Unknown)?;
                axis.put(item, value)?;
            }
        }
        Ok(())
    }
}

impl AxisSettings {
    /// Settings of an axis of this kind that are all zero, but for a plain motor driver.
    fn blank(kind: AxisKind) -> Self {
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
    fn item(&self, item: SettingItem) -> Option<i64> {
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
            SettingItem::Driver => (driver.kind == DriverKind::Tmc2209).into(),
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
            SettingItem::Encoder => encoder.is_absolute().into(),
            SettingItem::EncoderZero => encoder.zero.into(),
            _ => return None,
        })
    }

    fn put(&mut self, item: SettingItem, value: i64) -> Result<(), SettingError> {
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
            SettingItem::Driver => driver.kind = if flag(value)? { DriverKind::Tmc2209 } else { DriverKind::Plain },
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
            SettingItem::Encoder => {
                encoder.kind = if flag(value)? { EncoderKind::As5048a } else { EncoderKind::Quadrature };
            }
            SettingItem::EncoderZero => encoder.zero = number(value)?,
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

fn number(value: i64) -> Result<u32, SettingError> {
    u32::try_from(value).map_err(|_| SettingError::Value)
}

fn sensor(value: i64) -> Result<HomeSensor, SettingError> {
    match value {
        0 => Ok(HomeSensor::NormallyOpen),
        1 => Ok(HomeSensor::NormallyClosed),
        2 => Ok(HomeSensor::StallGuard),
        _ => Err(SettingError::Value),
    }
}

fn flag(value: i64) -> Result<bool, SettingError> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(SettingError::Value),
    }
}
