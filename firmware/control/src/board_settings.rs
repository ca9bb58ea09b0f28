//! The settings of a board: all axes, pose stream, serial line, machine and holding current, each readable as one number.

use vergence_dynamixel::Id;
use vergence_dynamixel::units::{Baud, BusWatchdog, Current};
use vergence_protocol::{AxisKind, AxisList, SettingItem, SettingKey};

use crate::axis_items::{flag, number};
use crate::joints::{BusSettings, JointSettings, origaker};
use crate::settings::{AxisSettings, SettingsError};

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

/// Default speed of the servos' bus in bits per second.
const SERVO_BAUD: u32 = 1_000_000;
/// Silence of 100 ms after which servos stop by themselves: some forty exchanges.
const BOARD_DIED: BusWatchdog = BusWatchdog(5);

/// The machine that a board drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Machine {
    /// The stages of the bench.
    #[default]
    Bench,
    /// The joints of the robot, on its servo bus.
    Robot,
}

/// The settings with which a board was delivered, for each machine that it can drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivered {
    /// The machine that the board drives where nothing else was saved.
    pub machine: Machine,
    /// Those of the bench.
    pub bench: BoardSettings,
    /// Those of the robot.
    pub robot: BoardSettings,
}

impl Delivered {
    /// A board of a bench, which can drive Origaker's joints as well.
    #[must_use]
    pub fn for_bench(bench: BoardSettings) -> Self {
        let joints = origaker::joints().into_iter().collect();
        Self { machine: Machine::Bench, bench, robot: BoardSettings::delivered(joints) }
    }

    /// Those of a machine.
    #[must_use]
    pub fn of(&self, machine: Machine) -> &BoardSettings {
        match machine {
            Machine::Bench => &self.bench,
            Machine::Robot => &self.robot,
        }
    }
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
    /// The machine that the board drives from its next start on.
    pub machine: Machine,
    /// Time in microseconds at rest after which the motors get their holding current; 0 for never.
    pub hold_after_us: u32,
    /// Speed of the servos' bus in bits per second.
    pub servo_baud: u32,
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
        let mut settings = Self {
            axes,
            stream_period_us: STREAM_US,
            baud: USUAL_BAUD,
            machine: Machine::Bench,
            hold_after_us: HOLD_AFTER_US,
            servo_baud: SERVO_BAUD,
        };
        settings.machine = settings.machine_of_axes();
        settings
    }

    /// The machine that has such axes.
    pub(crate) fn machine_of_axes(&self) -> Machine {
        if self.axes.first().is_some_and(AxisSettings::is_joint) { Machine::Robot } else { Machine::Bench }
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
        self.validate_joints()?;
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

    fn validate_joints(&self) -> Result<(), SettingsError> {
        let joints = self.axes.iter().filter(|axis| axis.is_joint());
        let are_mixed = ![0, self.axes.len()].contains(&joints.clone().count());
        let is_repeated = |id| joints.clone().filter(|joint| joint.driver.servo_id == id).count() > 1;
        if are_mixed || joints.clone().any(|joint| is_repeated(joint.driver.servo_id)) {
            return Err(SettingsError::Joints);
        }
        // At 9600 bit/s a move would be steered once in half a second.
        let is_baud = |baud: &Baud| *baud != Baud::B9600 && baud.bits_per_second() == self.servo_baud;
        if Baud::ALL.iter().any(is_baud) { Ok(()) } else { Err(SettingsError::Link) }
    }

    /// Settings of the joints' bus; `None` where the axes are no joints.
    #[must_use]
    pub fn joint_bus(&self) -> Option<BusSettings> {
        let joints = self.axes.iter().filter(|axis| axis.is_joint()).filter_map(|axis| {
            let id = Id::servo(u8::try_from(axis.driver.servo_id).ok()?).ok()?;
            Some(JointSettings { id, current_limit: Current::of_milliamperes(axis.driver.run_ma).0.unsigned_abs() })
        });
        let joints: AxisList<JointSettings> = joints.collect();
        (!joints.is_empty()).then_some(BusSettings { joints, baud: self.servo_baud, watchdog: BOARD_DIED })
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
            SettingKey { item: SettingItem::ServoBaud, axis: 0 } => Some(self.servo_baud.into()),
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
        // Joints are the machine's.
        if self.axes.iter().zip(&changed.axes).any(|(old, new)| old.is_joint() != new.is_joint()) {
            return Err(SettingError::Value);
        }
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
            SettingItem::ServoBaud => self.servo_baud = number(value)?,
            SettingItem::Machine => self.machine = if flag(value)? { Machine::Robot } else { Machine::Bench },
            item => {
                let axis = self.axes.get_mut(usize::from(key.axis)).ok_or(SettingError::Unknown)?;
                axis.put(item, value)?;
            }
        }
        Ok(())
    }
}
