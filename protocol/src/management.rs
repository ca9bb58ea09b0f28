//! Management messages: identify the board, update its firmware, restart it.
//!
//! They are frozen for ever, apart from all other messages, so that a tool of any age can update a board of any age and a
//! boot loader needs no other messages. They travel in frames of [`crate::frame::Kind::Firmware`], with or without a
//! session, whatever major version the header names.
//!
//! The board decides the offset: each answer names the byte it wants next, and the host continues there.

use core::fmt;

use heapless::Vec;
use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64;
use serde::{Deserialize, Serialize};

/// Largest number of image bytes in one chunk: a multiple of the eight bytes that the flash programs at once.
pub const CHUNK: usize = 224;

/// Hardware id of the simulated board that runs on the host: "VGSS", little-endian.
pub const NATIVE_HARDWARE: u32 = 0x5353_4756;

/// A management request of the host. The order is frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Management {
    /// Asks for [`ManagementReport::Identity`]. All other requests are answered by [`ManagementReport::Progress`].
    Identify,
    /// Announces an image. Refused unless the board is disarmed.
    Begin(ImageHeader),
    /// Sends bytes of the image.
    Chunk {
        /// Offset of the bytes in the image; a multiple of eight.
        offset: u32,
        /// The bytes; the last chunk is filled up with 0xFF to a multiple of eight.
        data: Vec<u8, CHUNK>,
    },
    /// Ends the image: the board checks it and starts it on trial at the next reboot.
    Commit(Signature),
    /// Keeps the image on trial.
    Confirm,
    /// Returns to the image before this one at the next reboot.
    Rollback,
    /// Restarts the board.
    Reboot(RebootTo),
}

/// Hash over names, order and types of all management messages. It must never change.
#[must_use]
pub const fn schema_hash() -> u64 {
    let requests = u64::from_le_bytes(fnv1a64::hash_ty_path::<Management>("management"));
    let reports = u64::from_le_bytes(fnv1a64::hash_ty_path::<ManagementReport>("management_report"));
    requests.rotate_left(1) ^ reports
}

/// Description of an image. The image's signature covers these fields in this order, integers little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ImageHeader {
    /// Id of the hardware that the image is made for.
    pub hardware: u32,
    /// Version of the image: major, minor, patch.
    pub version: [u8; 3],
    /// Length of the image in bytes.
    pub length: u32,
    /// Build id of the image.
    pub build: u64,
    /// SHA-256 of the image's bytes.
    pub sha256: [u8; 32],
}

impl ImageHeader {
    /// Number of signed bytes.
    pub const SIGNED: usize = 51;

    /// The bytes that the signature covers.
    #[must_use]
    pub fn signed_bytes(&self) -> [u8; Self::SIGNED] {
        let mut bytes = [0; Self::SIGNED];
        bytes[..4].copy_from_slice(&self.hardware.to_le_bytes());
        bytes[4..7].copy_from_slice(&self.version);
        bytes[7..11].copy_from_slice(&self.length.to_le_bytes());
        bytes[11..19].copy_from_slice(&self.build.to_le_bytes());
        bytes[19..].copy_from_slice(&self.sha256);
        bytes
    }
}

/// An Ed25519 signature (RFC 8032, section 5.1.6): R, then S.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Signature {
    /// First half: the encoded point R.
    pub r: [u8; 32],
    /// Second half: the scalar S.
    pub s: [u8; 32],
}

/// Program to start at a reboot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum RebootTo {
    /// The application.
    Application,
    /// The boot loader's serial recovery.
    Recovery,
}

/// An answer of the board to a management request. The order is frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ManagementReport {
    /// Identity of the board and of its program.
    Identity(Identity),
    /// State of an update, and the outcome of a request.
    Progress {
        /// Sequence number of the request.
        to: u8,
        /// The next byte of the image that the board wants.
        next: u32,
        /// Whether the request was carried out, or why not.
        outcome: Outcome,
    },
}

/// Identity of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// Id of the hardware: images must name the same.
    pub hardware: u32,
    /// Version of the running program: major, minor, patch.
    pub version: [u8; 3],
    /// Oldest version that the board accepts: major, minor, patch.
    pub oldest: [u8; 3],
    /// Build id of the running program.
    pub build: u64,
    /// Kind of program that runs.
    pub boot: BootState,
    /// Length of the longest image that the board accepts, in bytes.
    pub capacity: u32,
}

/// The running program and the reason why it was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum BootState {
    /// A confirmed application.
    Confirmed,
    /// A new application; unless it is confirmed, the board returns to the earlier one.
    Trial,
    /// The earlier application: the new one was not confirmed, or a rollback was requested.
    Reverted,
    /// The boot loader, because no application starts.
    Recovery,
}

/// Outcome of a management request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Outcome {
    /// Carried out.
    Done,
    /// The board is armed, an image on trial must be confirmed first, or another image waits for the reboot.
    Busy,
    /// No update has begun: send `Begin` first.
    NotBegun,
    /// The image is for other hardware.
    WrongHardware,
    /// The image is empty or longer than the board has room for, or a chunk lies outside the image.
    WrongLength,
    /// The image is older than the oldest version the board accepts.
    TooOld,
    /// The image's SHA-256 differs from the header's.
    WrongDigest,
    /// The signature is not of a key that the board trusts.
    WrongSignature,
    /// The flash could not be written.
    FlashFailed,
    /// There is no earlier image.
    NothingToRollBack,
    /// Bytes before these are missing: continue at the byte that the answer names.
    Missing,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Done => "done",
            Self::Busy => "the board is armed or has an unconfirmed image: disarm, or confirm, and try again",
            Self::NotBegun => "the board has no update in progress: start the update again",
            Self::WrongHardware => "the image is for other hardware",
            Self::WrongLength => "the image is empty or longer than the board has room for",
            Self::TooOld => "the image is older than the oldest version the board accepts",
            Self::WrongDigest => "the image arrived damaged: its SHA-256 is wrong",
            Self::WrongSignature => "the image is not signed with a key the board trusts",
            Self::FlashFailed => "the board could not write its flash",
            Self::NothingToRollBack => "there is no earlier image to go back to",
            Self::Missing => "bytes of the image are missing: continue at the byte that the board asks for",
        })
    }
}

impl fmt::Display for BootState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Confirmed => "confirmed",
            Self::Trial => "on trial",
            Self::Reverted => "reverted to the earlier image",
            Self::Recovery => "boot loader recovery",
        })
    }
}
