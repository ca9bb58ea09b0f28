//! The frame on the wire: `COBS(major kind seq ack | postcard body | CRC-32C) 0x00`.
//!
//! COBS (Cheshire and Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM ToN 7(2), 1999) keeps 0x00 out of the
//! frame's contents, so that a receiver which lost its place finds the next frame after the next 0x00. postcard has no
//! check of its own, so a CRC follows the body: CRC-32C (Castagnoli, as in RFC 3720), which finds every error of up to
//! five bits in packets of this length (Koopman, "32-Bit Cyclic Redundancy Codes for Internet Applications", DSN 2002).

use crc::{CRC_32_ISCSI, Crc, Table};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Largest length of a frame on the wire in bytes, with a 0x00 before and after it.
pub const MAX_FRAME: usize = 256;
/// Largest length of header, body and CRC together in bytes: below 254 bytes COBS adds exactly one.
pub const MAX_PACKET: usize = MAX_FRAME - 3;
/// Largest length of a body in bytes.
pub const MAX_BODY: usize = MAX_PACKET - HEADER - CRC;
const HEADER: usize = 4;
const CRC: usize = 4;
const CASTAGNOLI: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// Purpose of a frame. The numbers are frozen for ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Requests that are delivered once and in order, their answers, and events.
    Control = 0,
    /// Poses.
    Telemetry = 1,
    /// Bytes of the board's log.
    Log = 2,
    /// Management messages ([`crate::management`]), firmware images among them.
    Firmware = 3,
    /// Requests outside the order (`Hello`, `Heartbeat`, `TimeProbe`, `Stop`, `GetInfo`) and their answers.
    Immediate = 4,
    /// No body: the header's acknowledgement is all.
    AckOnly = 0x80,
    /// No body: the request after the one that the header acknowledges is missing.
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

/// The first four bytes of a frame. Frozen for ever, so that frames of every protocol major can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Protocol major version of the sender.
    pub major: u8,
    /// Purpose of the frame.
    pub kind: Kind,
    /// Sequence number: the host numbers its requests, each kind of frame for itself; the board numbers its frames.
    pub seq: u8,
    /// Last number received from the other side: the board names the last request received in order, the host the last
    /// frame received.
    pub ack: u8,
}

/// A frame with a correct CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Header of the frame. Its `major` may differ from ours: the reader of the body decides what that means.
    pub header: Header,
    body: &'a [u8],
}

/// Why bytes are no frame, or a message does not fit one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Longer than [`MAX_FRAME`].
    #[error("the frame is longer than {} bytes", MAX_FRAME)]
    TooLong,
    /// Shorter than header and CRC.
    #[error("the frame is shorter than its header and checksum")]
    TooShort,
    /// The byte stuffing contradicts itself.
    #[error("the frame's byte stuffing (COBS) is broken")]
    Stuffing,
    /// The CRC is wrong.
    #[error("the frame's checksum is wrong")]
    Checksum,
    /// A number that stands for no [`Kind`].
    #[error("the frame is of an unknown kind")]
    Kind,
    /// The body is another message, or bytes follow the message.
    #[error("the frame's body is not the expected message")]
    Body,
}

/// CRC-32C of `bytes`.
#[must_use]
pub const fn checksum(bytes: &[u8]) -> u32 {
    CASTAGNOLI.checksum(bytes)
}

/// Writes `body` as one frame with its closing 0x00 to the start of `buffer`; returns the frame's length in bytes. Kinds
/// without a body take `&()`.
///
/// # Errors
/// [`FrameError::TooLong`] if the body takes more than [`MAX_BODY`] bytes.
///
/// ```
/// use vergence_protocol::frame::{Header, Kind, encode};
/// use vergence_protocol::{MAX_FRAME, Request};
///
/// let header = Header { major: 1, kind: Kind::Immediate, seq: 7, ack: 0 };
/// let mut buffer = [0; MAX_FRAME];
/// let length = encode(header, &Request::GetInfo, &mut buffer)?;
/// // A COBS byte (the first zero is 4 bytes on), header, body of one byte, four bytes of CRC, and the closing zero.
/// assert_eq!((length, &buffer[..4], buffer[length - 1]), (11, &[4, 1, 4, 7][..], 0));
/// # Ok::<(), vergence_protocol::frame::FrameError>(())
/// ```
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
    /// Checks a packet: the bytes between two 0x00, with the byte stuffing undone.
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

    /// Decodes the message in the body.
    ///
    /// # Errors
    /// [`FrameError::Body`] if the body is no `B`, or bytes follow it.
    pub fn body<B: DeserializeOwned>(&self) -> Result<B, FrameError> {
        match postcard::take_from_bytes(self.body) {
            Ok((body, [])) => Ok(body),
            _ => Err(FrameError::Body),
        }
    }
}
