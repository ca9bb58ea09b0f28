//! The answer of one servo.

use thiserror::Error;

use crate::id::Id;
use crate::instruction::InstructionCode;
use crate::receiver::Packet;

/// The answer of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: Id,
    /// Whether the servo has a hardware error: read [`crate::table::HARDWARE_ERROR_STATUS`].
    pub alert: bool,
    /// Why the instruction was not carried out; `None`, if it was.
    pub error: Option<StatusError>,
    /// What was asked for.
    pub data: &'a [u8],
}

/// Why a servo did not carry out an instruction (e-manual, "Error").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum StatusError {
    /// It could not.
    #[error("the servo could not carry out the instruction")]
    ResultFail,
    /// It does not know the instruction, or there was no write for an action.
    #[error("the servo does not know the instruction, or nothing was registered for its action")]
    Instruction,
    /// The packet arrived damaged.
    #[error("the servo received a packet with a wrong CRC")]
    Crc,
    /// A value outside of what the register takes.
    #[error("a value is outside the range of its register")]
    DataRange,
    /// Fewer bytes than the register has.
    #[error("fewer bytes were written than the register has")]
    DataLength,
    /// A value outside of a limit that the servo is set to.
    #[error("a value is outside a limit that the servo is set to")]
    DataLimit,
    /// The register cannot be written or read, or not while torque is on.
    #[error("the register cannot be accessed, or not while torque is enabled")]
    Access,
    /// A number that the manual does not have.
    #[error("the servo states an unknown error {0}")]
    Unknown(u8),
}

impl StatusError {
    /// The error of the low seven bits of an error byte.
    #[must_use]
    pub const fn of_byte(byte: u8) -> Option<Self> {
        Some(match byte & 0x7F {
            0 => return None,
            1 => Self::ResultFail,
            2 => Self::Instruction,
            3 => Self::Crc,
            4 => Self::DataRange,
            5 => Self::DataLength,
            6 => Self::DataLimit,
            7 => Self::Access,
            other => Self::Unknown(other),
        })
    }

    /// The number on the wire, 1 to 127.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::ResultFail => 1,
            Self::Instruction => 2,
            Self::Crc => 3,
            Self::DataRange => 4,
            Self::DataLength => 5,
            Self::DataLimit => 6,
            Self::Access => 7,
            Self::Unknown(other) => other & 0x7F,
        }
    }
}

/// Bit of the error byte that says that the servo has a hardware error.
pub(crate) const ALERT: u8 = 0x80;

/// The packet is not the answer of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the packet is not the answer of one servo")]
pub struct NotAStatus;

/// What a servo says to a ping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PingInfo {
    /// Its kind; 1020 is the XM430-W350.
    pub model: u16,
    /// Version of its firmware.
    pub firmware: u8,
}

impl<'a> Status<'a> {
    /// Reads a packet as the answer of one servo.
    ///
    /// # Errors
    /// [`NotAStatus`] for an instruction, a combined answer, or an answer without an error byte.
    pub fn of(packet: &Packet<'a>) -> Result<Self, NotAStatus> {
        let is_one = packet.instruction == InstructionCode::Status as u8 && packet.id != Id::BROADCAST;
        match packet.parameters {
            [error, data @ ..] if is_one => {
                Ok(Self { id: packet.id, alert: error & ALERT != 0, error: StatusError::of_byte(*error), data })
            }
            _ => Err(NotAStatus),
        }
    }

    /// Reads the answer as that to a ping; `None` where it has another length.
    #[must_use]
    pub fn ping_info(&self) -> Option<PingInfo> {
        match self.data {
            [a, b, firmware] => Some(PingInfo { model: u16::from_le_bytes([*a, *b]), firmware: *firmware }),
            _ => None,
        }
    }
}
