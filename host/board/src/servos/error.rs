//! Why a servo cannot be asked or set.

use vergence_dynamixel::StatusError;

/// Why something with a servo failed. The text says what, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ServoError {
    /// The adapter's port cannot be opened or used.
    #[error("{port}: {why}; is the adapter plugged in, and may you use it?")]
    Port {
        /// Name of the port.
        port: String,
        /// What the system says.
        why: String,
    },
    /// No answer.
    #[error(
        "servo {id} does not answer at {baud} bit/s: check its supply and the wire, and find it by 'vergence servo scan'"
    )]
    Silent {
        /// Number of the servo.
        id: u8,
        /// Speed of the line in bits per second.
        baud: u32,
    },
    /// Answers that are none.
    #[error(
        "answers at {0} bit/s are garbled: two servos have one number, or the wire is bad; connect one servo at a time"
    )]
    Garbled(u32),
    /// The number is taken.
    #[error("number {0} is taken by another servo: choose another, or connect one servo at a time")]
    Taken(u8),
    /// The servo holds its joint.
    #[error("servo {0} has torque on: its settings are locked, and its joint would fall; disarm the robot first")]
    Torque(u8),
    /// The servo refuses.
    #[error("servo {id} refuses: {why}")]
    Refused {
        /// Number of the servo.
        id: u8,
        /// Its reason.
        why: StatusError,
    },
    /// What was written is not what is read.
    #[error("servo {id} has kept {name} = {has} in place of {wanted}")]
    NotKept {
        /// Number of the servo.
        id: u8,
        /// Name of the register.
        name: &'static str,
        /// What it has.
        has: i64,
        /// What was written.
        wanted: i64,
    },
    /// A number that no servo can have.
    #[error("{0} is no number of a servo: choose 0 to 252")]
    NoId(u16),
    /// A speed that no servo has.
    #[error(
        "{0} bit/s is no speed of a servo: choose 9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000 or 4500000"
    )]
    NoBaud(u32),
    /// A packet that cannot be made.
    #[error("the packet is too long")]
    TooLong,
}

impl From<vergence_dynamixel::Full> for ServoError {
    fn from(_: vergence_dynamixel::Full) -> Self {
        Self::TooLong
    }
}
