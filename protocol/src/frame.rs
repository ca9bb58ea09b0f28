//! One frame: `COBS(major kind seq ack | postcard body | CRC-32C) 0x00`.
//!
//! COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM ToN 7(2), 1999) leaves 0x00 to end frames
//! alone, so a receiver that lost its place finds it again at the next 0x00. postcard does not check itself: the CRC
//! does. It is CRC-32C (Castagnoli, as in RFC 3720), which finds every error of up to five bits in packets of this
//! length (Koopman, "32-Bit Cyclic Redundancy Codes for Internet Applications", DSN 2002).

use crc::{CRC_32_ISCSI, Crc, Table};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The most bytes a frame takes on the wire, with a 0x00 on both sides.
pub const MAX_FRAME: usize = 256;
/// The most bytes of header, body and CRC together: below 254 bytes COBS adds exactly one.
pub const MAX_PACKET: usize = MAX_FRAME - 3;
/// The most bytes of a body.
pub const MAX_BODY: usize = MAX_PACKET - HEADER - CRC;
const HEADER: usize = 4;
const CRC: usize = 4;
const CASTAGNOLI: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// What a frame is for. The numbers are frozen for ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Requests that arrive once and in order, their answers, and events.
    Control = 0,
    /// Poses.
    Telemetry = 1,
    /// Log text.
    Log = 2,
    /// Firmware images.
    Firmware = 3,
    /// Requests outside the order (`Hello`, `Heartbeat`, `TimeProbe`, `Stop`) and their answers.
    Immediate = 4,
    /// No body: only the acknowledgement in the header.
    AckOnly = 0x80,
    /// No body: what follows the acknowledgement in the header is missing.
    Nak = 0x81,
}

impl Kind {
    const fn from_byte(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::Control,
            1 => Self::Telemetry,
            2 => Self::Log,
            3 => Self::Firmware,
            4 => Self::Immediate,
            0x80 => Self::AckOnly,
            0x81 => Self::Nak,
            _ => return None,
        })
    }
}

/// The first four bytes. Frozen for ever: a frame of any major can be told by them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Protocol major of the sender.
    pub major: u8,
    /// What the frame is for.
    pub kind: Kind,
    /// Sender's number: of the request (host; one count for each kind), of the frame (board).
    pub seq: u8,
    /// Last number received from the other side: in order (board), at all (host).
    pub ack: u8,
}

/// A frame whose CRC holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// What it is for. Its `major` may be another than ours: whoever reads the body decides what that means.
    pub header: Header,
    body: &'a [u8],
}

/// Why bytes are no frame or a message no body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Longer than [`MAX_FRAME`].
    #[error("longer than a frame may be")]
    TooLong,
    /// Shorter than header and CRC.
    #[error("shorter than header and checksum")]
    TooShort,
    /// The byte stuffing contradicts itself.
    #[error("broken byte stuffing")]
    Stuffing,
    /// The CRC does not hold.
    #[error("wrong checksum")]
    Checksum,
    /// An unknown kind.
    #[error("unknown kind of frame")]
    Kind,
    /// The body is another message, or bytes are left after it.
    #[error("the body is not the message expected")]
    Body,
}

/// CRC-32C of `bytes`.
#[must_use]
pub const fn checksum(bytes: &[u8]) -> u32 {
    CASTAGNOLI.checksum(bytes)
}

/// Writes `body` as one frame, its 0x00 included, to the start of `buffer`; returns its length. Kinds without a body
/// take `&()`.
///
/// # Errors
/// [`FrameError::TooLong`] where the body takes more than [`MAX_BODY`] bytes.
pub fn encode<B: Serialize>(header: Header, body: &B, buffer: &mut [u8; MAX_FRAME]) -> Result<usize, FrameError> {
    let mut packet = [0; MAX_PACKET];
    let (head, rest) = packet.split_at_mut(HEADER);
    head.copy_from_slice(&[header.major, header.kind as u8, header.seq, header.ack]);
    let body = postcard::to_slice(body, &mut rest[..MAX_BODY]).map_err(|_| FrameError::TooLong)?;
    let end = HEADER + body.len();
    let crc = checksum(&packet[..end]);
    packet[end..end + CRC].copy_from_slice(&crc.to_le_bytes());
    let length = cobs::try_encode(&packet[..end + CRC], buffer).map_err(|_| FrameError::TooLong)?;
    *buffer.get_mut(length).ok_or(FrameError::TooLong)? = 0;
    Ok(length + 1)
}

impl<'a> Frame<'a> {
    /// Checks a packet: what is between two 0x00, byte stuffing undone.
    ///
    /// # Errors
    /// [`FrameError::TooShort`], [`FrameError::Checksum`] or [`FrameError::Kind`].
    pub fn parse(packet: &'a [u8]) -> Result<Self, FrameError> {
        let (content, crc) = packet.split_last_chunk::<CRC>().ok_or(FrameError::TooShort)?;
        let (&[major, kind, seq, ack], body) = content.split_first_chunk::<HEADER>().ok_or(FrameError::TooShort)?;
        if checksum(content) != u32::from_le_bytes(*crc) {
            return Err(FrameError::Checksum);
        }
        let kind = Kind::from_byte(kind).ok_or(FrameError::Kind)?;
        Ok(Self { header: Header { major, kind, seq, ack }, body })
    }

    /// The message in the body.
    ///
    /// # Errors
    /// [`FrameError::Body`] where it is not a `B`, to the last byte.
    pub fn body<B: DeserializeOwned>(&self) -> Result<B, FrameError> {
        match postcard::take_from_bytes(self.body) {
            Ok((body, [])) => Ok(body),
            _ => Err(FrameError::Body),
        }
    }
}
