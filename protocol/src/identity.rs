//! Identity of each side: protocol version, hash over the shape of every message, and description of the board.

use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64;
use serde::{Deserialize, Serialize};

use crate::{Report, Request};

/// A protocol version. Sides of different majors understand only management messages, `Hello` and `GetInfo`. Sides of the
/// same major with different schema hashes may read but not move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ProtocolVersion {
    /// Rises when the frame or a frozen message changes.
    pub major: u8,
    /// Rises when messages are added or renamed.
    pub minor: u8,
}

/// The protocol version of this crate.
pub const PROTOCOL: ProtocolVersion = ProtocolVersion { major: 1, minor: 7 };

/// Hash over names, order and types of all messages. Two sides with equal hashes mean the same by the same bytes.
#[must_use]
pub const fn schema_hash() -> u64 {
    // A constant: otherwise the board's flash would hold all names, to hash them at run time.
    const HASH: u64 = {
        let requests = u64::from_le_bytes(fnv1a64::hash_ty_path::<Request>("request"));
        let reports = u64::from_le_bytes(fnv1a64::hash_ty_path::<Report>("report"));
        requests.rotate_left(1) ^ reports
    };
    HASH
}

/// Description of a board. Frozen for ever: an update tool of any age must be able to read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BoardInfo {
    /// Kind of board, such as `native-sim`.
    pub board: heapless::String<16>,
    /// Firmware version: major, minor, patch.
    pub firmware: [u8; 3],
    /// Build id of the firmware.
    pub build: u64,
    /// Unique id of the chip.
    pub uid: [u8; 12],
    /// Cause of the last start.
    pub reset: ResetCause,
    /// Number of axes that the board drives.
    pub axes: u8,
}

/// Cause of the board's last start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[non_exhaustive]
pub enum ResetCause {
    /// Power was switched on.
    PowerOn,
    /// The reset pin was pulled low, or the button was pressed.
    Pin,
    /// The firmware asked for the reset.
    Software,
    /// The watchdog was not fed in time.
    Watchdog,
}
