//! Why a firmware update failed, and what state it leaves.

use std::time::Duration;

use vergence_protocol::management::{Identity, Outcome};

use super::image::{hardware_name, version_text};
use crate::link::{LinkError, OpenError};

/// Why the firmware was not updated. The text is a sentence: what, where, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UpdateError {
    /// The link ended.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The port cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The link was lost too often, or did not come back, while the image was sent. The update can be resumed.
    #[error("{0}; give the same command again later: the update goes on where it stopped")]
    GoOnLater(String),
    /// The board refuses.
    #[error("the board refuses: {0}")]
    Refused(Outcome),
    /// The image is for other hardware.
    #[error("the image is for {}, the board is {}", hardware_name(*image), hardware_name(*board))]
    WrongHardware {
        /// The number in the image's header.
        image: u32,
        /// The board's number.
        board: u32,
    },
    /// The image is older than the board accepts.
    #[error("the image is version {}, the board accepts {} and newer", version_text(*image), version_text(*oldest))]
    TooOld {
        /// The image's version.
        image: [u8; 3],
        /// The oldest version that the board accepts.
        oldest: [u8; 3],
    },
    /// The image does not fit into the board's flash.
    #[error("the image has {length} bytes, the board has room for {capacity}")]
    TooLong {
        /// Bytes of the image.
        length: u32,
        /// Bytes that the board has room for.
        capacity: u32,
    },
    /// Another image is on trial.
    #[error("the board has an image on trial: keep it with 'vergence flash --confirm', or go back with --rollback")]
    OnTrial,
    /// Header and code of the image disagree.
    #[error("the image is not as long as its header says")]
    Length,
    /// No application starts.
    #[error("the board is in its boot loader, no application starts: send it an image with 'vergence flash --serial'")]
    NoApplication,
    /// The board still runs another image.
    #[error("the board did not start the other image: it runs build {:016x}, {}", .0.build, .0.boot)]
    NotStarted(Identity),
    /// The new image started and was given up.
    #[error(
        "what was started did not live for {lived:?}: the board runs {} (build {:016x}) again, {}",
        version_text(now.version), now.build, now.boot
    )]
    Died {
        /// The time that it should have lived.
        lived: Duration,
        /// What runs now.
        now: Identity,
    },
    /// The board does not answer after its restart.
    #[error(
        "the board does not answer since it was started again, for {0:?}: switch it off and on; what was not confirmed \
         goes back"
    )]
    Silent(Duration),
}
