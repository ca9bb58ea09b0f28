//! One question on the wire, who has answered it, and until when the master waits.

use vergence_dynamixel::StatusError;
use vergence_protocol::{AxisMask, Microseconds};

/// What was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Question {
    /// To start anew.
    Reboot(usize),
    /// Whether a joint is there.
    Ping(usize),
    /// The register of a step of the set-up.
    Entry(usize),
    /// To take the value of a step of the set-up.
    Write(usize),
    /// The positions of all in one answer.
    Fast,
    /// The positions of all, one answer after the other.
    Sync,
    /// The position of one joint.
    Motion(usize),
    /// Whether one joint holds.
    State(usize),
    /// Voltage and temperature of one joint.
    Health(usize),
}

impl Question {
    /// The joint, where one alone is asked.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Reboot(joint)
            | Self::Ping(joint)
            | Self::Entry(joint)
            | Self::Write(joint)
            | Self::Motion(joint)
            | Self::State(joint)
            | Self::Health(joint) => Some(joint),
            Self::Fast | Self::Sync => None,
        }
    }
}

/// A question that waits for its answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exchange {
    pub question: Question,
    /// When the question was complete on the wire: servos read their registers then.
    pub asked_at: Microseconds,
    /// When the answer is overdue.
    pub until: Microseconds,
    /// Joints that have not answered yet.
    pub awaited: AxisMask,
    /// Whether a servo that was not asked has answered.
    pub stranger: bool,
    /// What the joint asked alone refused.
    pub refusal: Option<StatusError>,
    /// Wrong CRCs that the receiver had counted before.
    pub crc_errors: u32,
}
