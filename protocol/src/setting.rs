//! Settings of the board, read and written one number at a time.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What can be set. Append only: the order is the wire format. Lengths and rates are in micro-units of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum SettingItem {
    /// Lowest position a move may ask for.
    Min,
    /// Highest position a move may ask for.
    Max,
    /// Largest speed, per second.
    Speed,
    /// Largest acceleration, per second squared.
    Acceleration,
    /// Largest jerk, per second cubed.
    Jerk,
    /// Motor steps per metre or revolution.
    StepsPerUnit,
    /// Encoder counts per metre or revolution.
    CountsPerUnit,
    /// 1 where the motor turns the other way round.
    StepsReversed,
    /// 1 where the encoder counts the other way round.
    CountsReversed,
    /// Largest difference between command and encoder in motion.
    FollowingError,
    /// Largest difference between target and encoder at which a move counts as reached.
    Tolerance,
    /// How far the last approach comes from below, so that play is always taken up on the same side; 0 where there is none.
    Backlash,
    /// Where the home switch closes.
    HomeSwitchAt,
    /// Speed of the search for the home switch, and of jogs without reference.
    HomeSeekSpeed,
    /// Speed of the second approach.
    HomeApproachSpeed,
    /// How far to back off between the two.
    HomeRetract,
    /// Largest way of the search.
    HomeTravel,
    /// Largest difference between the two edges.
    HomeRepeatability,
    /// Not of an axis: period of the pose stream from the opening of a session on, microseconds; 0 for none.
    StreamPeriod,
    /// Not of an axis: speed of the serial line from the next start on, baud.
    Baud,
    /// Not of an axis: what the board drives, 0 the stages of the bench, 1 the joints of the robot.
    Machine,
}

impl SettingItem {
    /// Every item, in the order of the wire.
    pub const ALL: [Self; 21] = [
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
    ];

    /// Whether there is one for each axis.
    #[must_use]
    pub const fn is_of_axis(self) -> bool {
        !matches!(self, Self::StreamPeriod | Self::Baud | Self::Machine)
    }

    /// Its name for people and files.
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
        }
    }
}

/// One setting of one board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, Schema)]
pub struct SettingKey {
    /// What.
    pub item: SettingItem,
    /// Of which axis; 0 where the item is not of an axis.
    pub axis: u8,
}
