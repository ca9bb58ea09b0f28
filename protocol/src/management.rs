//! Management: who are you, take this firmware, start again. Frozen for ever, apart from all other messages, so that a
//! tool of any age can update a board of any age, and a boot loader needs nothing else. Travels in frames of
//! [`crate::frame::Kind::Firmware`], with or without a session, whatever major the header names.
//!
//! The board is master of the offset: each answer says which byte it wants next, and the host goes on from there.

use core::fmt;

use heapless::Vec;
use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64;
use serde::{Deserialize, Serialize};

/// The most image bytes in one chunk: a multiple of the flash's eight.
pub const CHUNK: usize = 224;

/// What the host asks. The order is frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Management {
    /// Who are you? Answered by [`ManagementReport::Identity`]; all else by [`ManagementReport::Progress`].
    Identify,
    /// An image follows. Refused unless the board is disarmed.
    Begin(ImageHeader),
    /// Bytes of the image.
    Chunk {
        /// Where they belong; a multiple of eight.
        offset: u32,
        /// The bytes; the last chunk is filled up with 0xFF to a multiple of eight.
        data: Vec<u8, CHUNK>,
    },
    /// The image is whole: check it, and start it on trial at the next reboot.
    Commit(Signature),
    /// The image on trial is good: keep it.
    Confirm,
    /// Go back to the image before this one at the next reboot.
    Rollback,
    /// Start again.
    Reboot(RebootTo),
}

/// A hash of the names, order and types of all management messages. It must never change.
#[must_use]
pub const fn schema_hash() -> u64 {
    let requests = u64::from_le_bytes(fnv1a64::hash_ty_path::<Management>("management"));
    let reports = u64::from_le_bytes(fnv1a64::hash_ty_path::<ManagementReport>("management_report"));
    requests.rotate_left(1) ^ reports
}

/// What an image says of itself, and what its signature covers: these fields in this order, integers little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ImageHeader {
    /// The hardware it is made for.
    pub hardware: u32,
    /// Its version: major, minor, patch.
    pub version: [u8; 3],
    /// Its length in bytes.
    pub length: u32,
    /// Which build.
    pub build: u64,
    /// SHA-256 of its bytes.
    pub sha256: [u8; 32],
}

impl ImageHeader {
    /// How many bytes are signed.
    pub const SIGNED: usize = 51;

    /// The bytes that are signed.
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

/// An Ed25519 signature (RFC 8032): R, then S.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Signature {
    /// First half.
    pub r: [u8; 32],
    /// Second half.
    pub s: [u8; 32],
}

/// What to start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum RebootTo {
    /// The application.
    Application,
    /// The boot loader's serial recovery.
    Recovery,
}

/// What the board answers. The order is frozen for ever.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ManagementReport {
    /// Who it is.
    Identity(Identity),
    /// Where an update stands.
    Progress {
        /// Sequence number of the request.
        to: u8,
        /// The next byte of the image that the board wants.
        next: u32,
        /// Whether the request was carried out.
        outcome: Outcome,
    },
}

/// Who answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// The hardware: images must name the same.
    pub hardware: u32,
    /// Version of what runs: major, minor, patch.
    pub version: [u8; 3],
    /// Oldest version it accepts.
    pub oldest: [u8; 3],
    /// Which build.
    pub build: u64,
    /// What runs.
    pub boot: BootState,
    /// The longest image it takes, in bytes.
    pub capacity: u32,
}

/// What runs, and how it came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum BootState {
    /// A confirmed application.
    Confirmed,
    /// A new application that goes back unless it is confirmed.
    Trial,
    /// The application before: the new one was not confirmed, or a rollback was asked for.
    Reverted,
    /// The boot loader: no application starts.
    Recovery,
}

/// What became of a management request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Outcome {
    /// Carried out.
    Done,
    /// The board is armed, an image on trial must be confirmed first, or another one waits for the reboot.
    Busy,
    /// There is no update to go on with: begin first.
    NotBegun,
    /// The image is for other hardware.
    WrongHardware,
    /// The image is empty or longer than the board has room for, or a chunk does not lie in it.
    WrongLength,
    /// The image is older than the oldest version the board accepts.
    TooOld,
    /// The bytes do not have the digest that the header names.
    WrongDigest,
    /// The signature is not of a key the board trusts.
    WrongSignature,
    /// The flash could not be written.
    FlashFailed,
    /// There is no image before this one.
    NothingToRollBack,
    /// Bytes before these are missing: go on from the next byte wanted.
    Missing,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Done => "done",
            Self::Busy => "the board is armed or has an unconfirmed image: disarm, or confirm, and try again",
            Self::NotBegun => "the board knows of no update: begin again",
            Self::WrongHardware => "the image is for other hardware",
            Self::WrongLength => "the image is empty or longer than the board has room for",
            Self::TooOld => "the image is older than the oldest version the board accepts",
            Self::WrongDigest => "the image arrived damaged: its digest is another",
            Self::WrongSignature => "the image is not signed with a key the board trusts",
            Self::FlashFailed => "the board could not write its flash",
            Self::NothingToRollBack => "there is no earlier image to go back to",
            Self::Missing => "bytes of the image are missing: go on from the next one wanted",
        })
    }
}

impl fmt::Display for BootState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Confirmed => "confirmed",
            Self::Trial => "on trial",
            Self::Reverted => "reverted to the image before",
            Self::Recovery => "boot loader recovery",
        })
    }
}
