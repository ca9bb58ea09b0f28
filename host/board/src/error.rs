//! Why the board cannot or will not do what it was asked.

use std::time::Duration;

use vergence_protocol::{ProtocolVersion, Refusal};
use vergence_rig::AxisPosition;

use crate::link::{LinkError, OpenError};

/// Why an operation of the board failed. The text is a sentence: what, where, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoardError {
    /// The link ended.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The port cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// Board and host speak different protocol versions.
    #[error(
        "the board speaks protocol {}.{} and this program {}.{}: update the firmware or use the matching vergence",
        board.major, board.minor, ours.major, ours.minor
    )]
    Incompatible {
        /// The board's version.
        board: ProtocolVersion,
        /// The version of this program.
        ours: ProtocolVersion,
    },
    /// The board answered a question with a report of another kind.
    #[error("the board answered {0} with something else")]
    OtherAnswer(&'static str),
    /// The board does not describe one of its axes.
    #[error("the board does not describe its axis {0}")]
    NoAxis(u8),
    /// The rig file has another number of axes than the board.
    #[error("rig '{rig}' has {ours} axes and the board {theirs}: name the right rig file with --rig")]
    AxisCount {
        /// The rig's name.
        rig: String,
        /// Axes of the rig file.
        ours: usize,
        /// Axes of the board.
        theirs: usize,
    },
    /// An axis of the rig file is not the board's axis.
    #[error("{0}: name the right rig file with --rig")]
    OtherAxis(String),
    /// A target lies outside the range of its axis.
    #[error("{axis} {target} is out of range: choose {} to {}", range[0], range[1])]
    OutOfRange {
        /// The axis.
        axis: String,
        /// The target.
        target: AxisPosition,
        /// The ends of the range.
        range: [AxisPosition; 2],
    },
    /// No path of the trunk leads to the target.
    #[error("no path leads there: {0}")]
    NoPath(#[from] vergence_rig::linkage::NoPath),
    /// The board refuses the request.
    #[error("the board refuses: {refusal}{more}")]
    Refused {
        /// The board's reason.
        refusal: Refusal,
        /// The latched fault or the axis concerned, in parentheses; empty where there is nothing to add.
        more: String,
    },
    /// A fault was latched while something was done; the text says which and what to do.
    #[error("{0}")]
    Fault(String),
    /// Something took longer than anything on a bench takes.
    #[error("the board was still not done after {} s", .0.as_secs())]
    NotDone(Duration),
    /// The caller's interruption ended the work.
    #[error("interrupted: the stages have braked, and the board is disarmed")]
    Interrupted,
    /// Another command stopped the move.
    #[error("the move was stopped by another command: the stages stand where they are")]
    Stopped,
    /// The board is heard neither at the new speed of its line nor at the one before.
    #[error(
        "the board answers neither at {to} nor at {from} baud: check the cable; after a reset it listens at the saved speed \
         and at 921600 baud in turn"
    )]
    LineLost {
        /// The speed before.
        from: u32,
        /// The new speed.
        to: u32,
    },
    /// The mark of a trigger pulse did not arrive.
    #[error("the board fired the cameras but did not say where the axes were")]
    NoMark,
}
