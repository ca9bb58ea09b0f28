//! Which protocol this is, and a hash over the shape of every message.

use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64;
use serde::{Deserialize, Serialize};

use crate::{Report, Request};

/// A protocol version. Another major: nothing but management messages is understood. Same major, another schema hash:
/// the board may be read but not moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ProtocolVersion {
    /// Changes when the frame or a frozen message changes.
    pub major: u8,
    /// Changes when messages are added.
    pub minor: u8,
}

/// The version this crate speaks.
pub const PROTOCOL: ProtocolVersion = ProtocolVersion { major: 1, minor: 2 };

/// A hash of the names, order and types of all messages: equal on both sides exactly when both sides mean the same bytes.
#[must_use]
pub const fn schema_hash() -> u64 {
    // A constant, or a small board would carry the names of all types to hash them when it runs.
    const HASH: u64 = {
        let requests = u64::from_le_bytes(fnv1a64::hash_ty_path::<Request>("request"));
        let reports = u64::from_le_bytes(fnv1a64::hash_ty_path::<Report>("report"));
        requests.rotate_left(1) ^ reports
    };
    HASH
}
