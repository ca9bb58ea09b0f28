//! Settings of the board: names and keys. Settings are read and written one number at a time.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// One kind of setting. Append only: the order is the wire format. Positions, distances, speeds, accelerations and jerks
/// are in [`crate::Micro`] units of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum SettingItem {
    /// Lowest position a move may ask for.
    Min,
    /// Highest position a move may ask for.
    Max,
    /// Largest speed, in micro-units per second.
    Speed,
    /// Largest acceleration, in micro-units per second squared.
    Acceleration,
    /// Largest jerk, in micro-units per second cubed.
    Jerk,
    /// Motor steps per metre (linear axis) or per revolution (rotary axis).
    StepsPerUnit,
    /// Encoder counts per metre (linear axis) or per revolution (rotary axis).
    CountsPerUnit,
    /// 1 if the position rises while the motor's step count falls, else 0.
    StepsReversed,
    /// 1 if the position rises while the encoder's count falls, else 0.
    CountsReversed,
    /// Largest difference between commanded position and encoder before the board raises a fault.
    FollowingError,
    /// Largest difference between target and encoder at which a move counts as settled.
    Tolerance,
    /// Length of the last approach, which always comes from below, so that play is taken up on the same side; 0 for an
    /// axis without play.
    Backlash,
    /// Position at which the home switch closes.
    HomeSwitchAt,
    /// Speed of the search for the home switch, and of jogs without reference, in micro-units per second.
    HomeSeekSpeed,
    /// Speed of the second, slow approach to the home switch, in micro-units per second.
    HomeApproachSpeed,
    /// Distance to back off between the two approaches.
    HomeRetract,
    /// Largest distance that the search may travel.
    HomeTravel,
    /// Largest difference between the positions at which the two approaches find the switch.
    HomeRepeatability,
    /// Of the board: period of the pose stream when a session opens, in microseconds; 0 for no stream.
    StreamPeriod,
    /// Speed of the board's serial line in baud. It changes once the answer has left, and returns to the one before unless
    /// a session is heard at the new one within five seconds; only then can it be saved.
    Baud,
    /// Of the board: what it drives, 0 for the stages of the bench, 1 for the joints of the robot. It takes effect at the next start,
    /// with the settings of that machine as delivered.
    Machine,
    /// Motor driver of the axis: 0 for step and direction only, 1 for a TMC2209 with its serial line, 2 for the servo of a robot's
    /// joint. Servos belong to the machine: an axis cannot be changed from or to one.
    Driver,
    /// Resistors by which the driver measures the current, in milliohms.
    SenseResistor,
    /// Effective current of the motor in motion, in milliamperes; of a servo its current limit.
    RunCurrent,
    /// Effective current of the motor at rest, in milliamperes.
    HoldCurrent,
    /// Time at rest until the current falls, in microseconds.
    HoldDelay,
    /// Microsteps that the driver makes of a full step, a power of two up to 256.
    Microsteps,
    /// 1 if the driver regulates the voltage (quiet), 0 if it regulates the current.
    StealthChop,
    /// Of the board: time in microseconds at rest after which the motors get their holding current; 0 for never.
    HoldAfter,
    /// Largest error at the end of a move that a short second move corrects, as of a screw whose pitch varies; 0 for none.
    Correction,
    /// End of the range at which homing seeks: 0 for the low one, 1 for the high one.
    HomeEnd,
    /// What tells the axis that it is at home: 0 for a normally open switch, 1 for a normally closed one, 2 for StallGuard of
    /// its TMC2209, whose output DIAG is on the line of the switch.
    HomeSwitch,
    /// Contacts of the hard limit switches: 0 for normally closed, 1 for normally open.
    HardLimit,
    /// SGTHRS of a TMC2209, 1 to 255: it reports a stall where its StallGuard value is at most twice this.
    StallThreshold,
    /// 1 if a stall that the driver reports in a move is a fault, else 0.
    StallWatch,
    /// Encoder counts from one index pulse to the next; 0 for an encoder without index.
    IndexEvery,
    /// Encoder of the axis: 0 for two lines in quadrature, 1 for an AS5048A, which knows its angle, 2 for that of a servo.
    Encoder,
    /// Reading of an absolute encoder at the axis zero, in counts within its turn.
    EncoderZero,
    /// Number of the servo of a joint on its bus, 0 to 252.
    ServoId,
    /// Of the board: speed of the servos' bus in bits per second.
    ServoBaud,
}

impl SettingItem {
    /// Every item, in wire order.
    pub const ALL: [Self; 40] = [
        Self::Min,
        Self::Max,
        Self::Speed,
        Self::Acceleration,
        Self::Jerk,
        Self::StepsPerUnit,
        Self::CountsPerUnit,
        Self::StepsReversed,
        Self::CountsReversed,
        Self::FollowingError,
        Self::Tolerance,
        Self::Backlash,
        Self::HomeSwitchAt,
        Self::HomeSeekSpeed,
        Self::HomeApproachSpeed,
        Self::HomeRetract,
        Self::HomeTravel,
        Self::HomeRepeatability,
        Self::StreamPeriod,
        Self::Baud,
        Self::Machine,
        Self::Driver,
        Self::SenseResistor,
        Self::RunCurrent,
        Self::HoldCurrent,
        Self::HoldDelay,
        Self::Microsteps,
        Self::StealthChop,
        Self::HoldAfter,
        Self::Correction,
        Self::HomeEnd,
        Self::HomeSwitch,
        Self::HardLimit,
        Self::StallThreshold,
        Self::StallWatch,
        Self::IndexEvery,
        Self::Encoder,
        Self::EncoderZero,
        Self::ServoId,
        Self::ServoBaud,
    ];

    /// Whether each axis has a setting of this kind; else the board has one.
    #[must_use]
    pub const fn is_of_axis(self) -> bool {
        !matches!(self, Self::StreamPeriod | Self::Baud | Self::Machine | Self::HoldAfter | Self::ServoBaud)
    }

    /// The name that people type and files hold.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Min => "min",
            Self::Max => "max",
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::StepsPerUnit => "steps_per_unit",
            Self::CountsPerUnit => "counts_per_unit",
            Self::StepsReversed => "steps_reversed",
            Self::CountsReversed => "counts_reversed",
            Self::FollowingError => "following_error",
            Self::Tolerance => "tolerance",
            Self::Backlash => "backlash",
            Self::HomeSwitchAt => "home_switch_at",
            Self::HomeSeekSpeed => "home_seek_speed",
            Self::HomeApproachSpeed => "home_approach_speed",
            Self::HomeRetract => "home_retract",
            Self::HomeTravel => "home_travel",
            Self::HomeRepeatability => "home_repeatability",
            Self::StreamPeriod => "stream_period_us",
            Self::Baud => "baud",
            Self::Machine => "machine",
            Self::Driver => "driver",
            Self::SenseResistor => "sense_resistor",
            Self::RunCurrent => "run_current",
            Self::HoldCurrent => "hold_current",
            Self::HoldDelay => "hold_delay",
            Self::Microsteps => "microsteps",
            Self::StealthChop => "stealth_chop",
            Self::HoldAfter => "hold_after_us",
            Self::Correction => "correction",
            Self::HomeEnd => "home_end",
            Self::HomeSwitch => "home_switch",
            Self::HardLimit => "hard_limit",
            Self::StallThreshold => "stall_threshold",
            Self::StallWatch => "stall_watch",
            Self::IndexEvery => "index_every",
            Self::Encoder => "encoder",
            Self::EncoderZero => "encoder_zero",
            Self::ServoId => "servo_id",
            Self::ServoBaud => "servo_baud",
        }
    }
}

/// Names one setting of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, Schema)]
pub struct SettingKey {
    /// Kind of setting.
    pub item: SettingItem,
    /// Index of the axis, from 0; 0 for settings of the board.
    pub axis: u8,
}
