//! Fault codes: why the controller stopped by itself, and what a person can do about it.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::Microseconds;

/// Cause of a fault. Append only: the order is the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum FaultCode {
    /// The host fell silent for longer than its lease while the board was armed.
    LeaseExpired,
    /// The encoder and the commanded position disagree by more than the following-error limit.
    FollowingError,
    /// The encoder did not come to rest inside the tolerance after a move.
    NotSettled,
    /// The home switch did not close within the travel of the search.
    HomeSwitchNotFound,
    /// The home switch stayed closed while the axis moved away from it.
    HomeSwitchStuck,
    /// The home switch closed at two places that differ by more than the repeatability setting.
    HomeNotRepeatable,
    /// A hard limit switch opened: an axis is beyond its range, or the switch's wire is broken. The switches are normally
    /// closed.
    HardLimit,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The saved settings are not in effect: this firmware refuses them, or the board was started without them.
    BadSettings,
    /// The motor made steps but the encoder hardly moved.
    Stall,
    /// The encoder moved less far or further than the motor.
    Slip,
    /// The encoder counts in the direction opposite to the motor.
    WrongDirection,
    /// The encoder does not count, or jumps further than the axis can move.
    EncoderLost,
    /// The switch of another axis closed during homing.
    HomeSwitchWrong,
    /// The control tick came too late to keep to the trajectory.
    TickMissed,
    /// A motor driver does not answer on its serial line.
    DriverSilent,
    /// What a motor driver answers is garbled.
    DriverGarbled,
    /// A motor driver did not take its settings, or has others than it was given.
    DriverUnset,
    /// A motor driver was reset and has lost its settings, or its supply is too low.
    DriverReset,
    /// A motor driver is too hot and has switched its outputs off.
    DriverOverheated,
    /// A short circuit at the outputs of a motor driver, which has switched them off.
    DriverShort,
    /// A motor driver reported a stall in a move, or in homing where the stage moved freely.
    DriverStall,
    /// Homing by StallGuard met the end of the axis, and the motor driver reported no stall.
    StallMissed,
    /// At an index pulse the count of the encoder was another than at the pulses before: counts were lost or gained.
    EncoderDrift,
    /// The index pulse of the encoder did not come where it was due.
    IndexMissing,
    /// What an absolute encoder answers is garbled, or it did not understand its question.
    EncoderGarbled,
    /// The magnet of an absolute encoder is too weak or too strong, or not above it.
    EncoderMagnet,
    /// Another servo answers on the bus in place of the one that was asked.
    JointWrongId,
    /// The servo of a joint carried more than its largest load for long and has switched its torque off.
    JointOverload,
    /// The supply of a joint's servo is outside of its limits, or too weak for its motor; its torque is off.
    JointSupply,
}

impl FaultCode {
    /// What a person can do about this fault: an instruction that names the commands to run.
    #[must_use]
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::LeaseExpired => "check the cable and that the host is running, then 'vergence clear'",
            Self::FollowingError => {
                "look for an obstacle or a slipping coupling, then 'vergence clear' and 'vergence home'"
            }
            Self::NotSettled => {
                "look for backlash or vibration at the stage, and at the encoder's supply, then 'vergence clear' and 'vergence home'"
            }
            Self::HomeSwitchNotFound => {
                "check the home switch and its wiring, then 'vergence clear' and 'vergence home'"
            }
            Self::HomeSwitchStuck => "free or replace the home switch, then 'vergence clear' and 'vergence home'",
            Self::HomeNotRepeatable => "tighten the home switch, then 'vergence clear' and 'vergence home'",
            Self::HardLimit => {
                "check the switch's wire; 'vergence clear', then 'vergence move --by' a short way off the limit, and 'vergence home'"
            }
            Self::EmergencyStop => "release the emergency stop, then 'vergence clear' and 'vergence home'",
            Self::BadSettings => {
                "'vergence clear', set what your rig needs, then 'vergence config save'; or 'vergence config reload'"
            }
            Self::Stall => {
                "look for an obstacle, or lower speed and acceleration, then 'vergence clear' and 'vergence home'"
            }
            Self::Slip => "tighten the coupling between motor and stage, then 'vergence clear' and 'vergence home'",
            Self::WrongDirection => {
                "swap the encoder's channels or set 'counts_reversed', then 'vergence clear' and 'vergence home'"
            }
            Self::EncoderLost => "check the encoder's cable and supply, then 'vergence clear' and 'vergence home'",
            Self::HomeSwitchWrong => {
                "check that each home switch is wired to its own axis, then 'vergence clear' and 'vergence home'"
            }
            Self::TickMissed => "lower the rate of steps and poses, then 'vergence clear' and 'vergence home'",
            Self::DriverSilent => {
                "check the driver's supply, its serial wire and its address, then 'vergence clear' and 'vergence home'"
            }
            Self::DriverGarbled => {
                "check the drivers' serial wire, its pull-up and that no two drivers have the same address, then 'vergence clear' and 'vergence home'"
            }
            Self::DriverUnset => {
                "check that the driver is a TMC2209 and its serial wire is sound, then 'vergence clear' and 'vergence home'"
            }
            Self::DriverReset => "check the drivers' motor supply, then 'vergence clear' and 'vergence home'",
            Self::DriverOverheated => {
                "let the driver cool, lower 'run_current' or cool it better, then 'vergence clear' and 'vergence home'"
            }
            Self::DriverShort => {
                "switch off, check the motor and its wires for a short circuit, then 'vergence clear' and 'vergence home'"
            }
            Self::DriverStall => {
                "look for an obstacle; if the way was free, lower 'stall_threshold'; then 'vergence clear' and 'vergence home'"
            }
            Self::StallMissed => {
                "check the wire of DIAG, raise 'stall_threshold' or 'home_seek_speed', then 'vergence clear' and 'vergence home'"
            }
            Self::EncoderDrift => {
                "check the encoder's supply, shield and plug, and that its scale is clean, then 'vergence clear' and 'vergence home'"
            }
            Self::IndexMissing => {
                "check the encoder's index wire and the setting 'index_every', then 'vergence clear' and 'vergence home'"
            }
            Self::EncoderGarbled => {
                "check the wires between board and encoder: short, twisted with ground, then 'vergence clear'"
            }
            Self::EncoderMagnet => {
                "check the distance between magnet and encoder, and that it is centred, then 'vergence clear'"
            }
            Self::JointWrongId => {
                "give each servo a number of its own: connect them one at a time and set the number, then 'vergence clear'"
            }
            Self::JointOverload => {
                "look for what blocks the joint or loads it, restart the servo's supply, then 'vergence clear'"
            }
            Self::JointSupply => {
                "check the servos' supply and their cables, switch it off and on, then 'vergence clear'"
            }
        }
    }
}

impl fmt::Display for FaultCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LeaseExpired => "the host fell silent for longer than its lease",
            Self::FollowingError => "the stage did not follow its command",
            Self::NotSettled => "the stage did not come to rest at its target",
            Self::HomeSwitchNotFound => "homing did not find the switch",
            Self::HomeSwitchStuck => "the home switch stayed closed",
            Self::HomeNotRepeatable => "homing found the switch at two different places",
            Self::HardLimit => {
                "a hard limit switch opened: the stage is beyond its range or the switch's wire is broken"
            }
            Self::EmergencyStop => "the emergency stop is pressed",
            Self::BadSettings => "the saved settings are not in effect: the board runs with those of the factory",
            Self::Stall => "the motor was driven but the stage hardly moved",
            Self::Slip => "the stage moved less far or further than its motor",
            Self::WrongDirection => "the encoder counts against the motor",
            Self::EncoderLost => "the encoder does not answer",
            Self::HomeSwitchWrong => "homing closed the switch of another axis",
            Self::TickMissed => "the control tick came too late",
            Self::DriverSilent => "the motor driver does not answer",
            Self::DriverGarbled => "what the motor driver answers is garbled",
            Self::DriverUnset => "the motor driver does not have the settings that it was given",
            Self::DriverReset => "the motor driver has lost its supply and its settings",
            Self::DriverOverheated => "the motor driver was too hot and switched off",
            Self::DriverShort => "the motor driver found a short circuit and switched off",
            Self::DriverStall => "the motor driver reported a stall where the stage should move freely",
            Self::StallMissed => "homing met the end of the axis and the motor driver reported no stall",
            Self::EncoderDrift => "the encoder has lost or gained counts: its index pulse came at another count",
            Self::IndexMissing => "the encoder's index pulse did not come",
            Self::EncoderGarbled => "what the absolute encoder answers is garbled",
            Self::EncoderMagnet => "the absolute encoder reads its magnet badly",
            Self::JointWrongId => "another servo answers in place of the joint's",
            Self::JointOverload => "the joint's servo was overloaded and switched its torque off",
            Self::JointSupply => "the joint's servo has a supply outside of its limits",
        })
    }
}

/// The first fault since the last `ClearFault`; later faults are only counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct FaultRecord {
    /// Cause of the fault.
    pub code: FaultCode,
    /// Number of the fault since the board started. `ClearFault` must name it, so that only a fault that the host has
    /// read can be cleared.
    pub seq: u16,
    /// Time of the fault, board clock.
    pub at: Microseconds,
    /// Axis of the fault, if it concerns one axis.
    pub axis: Option<u8>,
    /// A number whose meaning depends on the code: the following error or the distance searched in micro-units, or the
    /// silence of the host in microseconds.
    pub detail: i32,
    /// Number of faults that came after this one.
    pub later: u16,
}
