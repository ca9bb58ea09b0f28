//! What can be wrong with a joint on the bus.

use vergence_dynamixel::StatusError;
use vergence_dynamixel::units::HardwareErrors;
use vergence_protocol::FaultCode;

/// Why a joint cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum JointFault {
    /// It does not answer.
    Silent,
    /// Its answers have a wrong CRC.
    Garbled,
    /// Another servo answers in its place.
    WrongId,
    /// It refused a setting, or has another value than was written.
    Refused(Option<StatusError>),
    /// Its torque is off although it was switched on: it started anew, or its bus watchdog has stopped it.
    TorqueLost,
    /// It found errors of its hardware and has switched its torque off.
    Hardware(HardwareErrors),
}

impl JointFault {
    /// Whether nothing is heard of the joint, so that asking it only costs time.
    #[must_use]
    pub const fn is_deaf(self) -> bool {
        matches!(self, Self::Silent | Self::Garbled | Self::WrongId)
    }

    /// The fault that the host is told.
    #[must_use]
    pub const fn code(self) -> FaultCode {
        match self {
            Self::Silent => FaultCode::DriverSilent,
            Self::Garbled => FaultCode::DriverGarbled,
            Self::WrongId => FaultCode::JointWrongId,
            Self::Refused(_) => FaultCode::DriverUnset,
            Self::TorqueLost => FaultCode::DriverReset,
            // The cause first, where several are set.
            Self::Hardware(errors) if errors.intersects(HardwareErrors::OVERHEATING) => FaultCode::DriverOverheated,
            Self::Hardware(errors) if errors.intersects(HardwareErrors::OVERLOAD) => FaultCode::JointOverload,
            Self::Hardware(errors) if errors.intersects(HardwareErrors::ENCODER) => FaultCode::EncoderLost,
            Self::Hardware(_) => FaultCode::JointSupply,
        }
    }
}

/// What the master has counted since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounters {
    /// Exchanges in which all goals were written and all positions read.
    pub cycles: u32,
    /// Exchanges that were not answered in time.
    pub timeouts: u32,
    /// Exchanges whose answer had a wrong CRC.
    pub garbled: u32,
    /// Answers of a servo that was not asked.
    pub wrong_ids: u32,
}
