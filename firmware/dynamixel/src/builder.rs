//! Bytes of one packet under construction: header, stuffing, length, CRC.

use heapless::Vec;
use thiserror::Error;

use crate::crc::crc16;
use crate::id::Id;

/// Longest packet that this crate sends or takes, in bytes, with header and CRC. Five servos need far less; a packet that
/// states more is refused, so that a flipped bit in the length cannot swallow much.
pub const MAX_PACKET: usize = 256;

/// A packet ready for the wire.
pub type Encoded = Vec<u8, MAX_PACKET>;

/// The parameters do not fit into one packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the packet would be longer than {MAX_PACKET} bytes: send it in parts")]
pub struct Full;

/// The bytes that start a packet, with the reserved byte.
pub(crate) const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Bytes before the instruction: header, id, length.
pub(crate) const BEFORE_INSTRUCTION: usize = 7;
pub(crate) const CRC_BYTES: usize = 2;

/// After these bytes a fourth is put in, so that no header stands inside a packet (e-manual, "Packet Process").
pub(crate) const TO_STUFF: [u8; 3] = [0xFF, 0xFF, 0xFD];
pub(crate) const STUFFING: u8 = 0xFD;

/// A packet of which the parameters are still to come.
pub(crate) struct Builder {
    bytes: Encoded,
}

impl Builder {
    pub(crate) fn new(id: Id, instruction: u8) -> Result<Self, Full> {
        let mut builder = Self { bytes: Vec::new() };
        builder.bytes.extend_from_slice(&HEADER).map_err(|_| Full)?;
        builder.bytes.extend_from_slice(&[id.get(), 0, 0, instruction]).map_err(|_| Full)?;
        Ok(builder)
    }

    /// Appends a byte, and the stuffing after it where the pattern is complete.
    pub(crate) fn push(&mut self, byte: u8) -> Result<(), Full> {
        self.bytes.push(byte).map_err(|_| Full)?;
        let inside = self.bytes.get(BEFORE_INSTRUCTION..).unwrap_or_default();
        if inside.ends_with(&TO_STUFF) {
            self.bytes.push(STUFFING).map_err(|_| Full)?;
        }
        Ok(())
    }

    pub(crate) fn extend(&mut self, bytes: &[u8]) -> Result<(), Full> {
        bytes.iter().try_for_each(|byte| self.push(*byte))
    }

    /// Appends a number of two bytes.
    pub(crate) fn word(&mut self, word: u16) -> Result<(), Full> {
        self.extend(&word.to_le_bytes())
    }

    /// Length and CRC, which cover the stuffing.
    pub(crate) fn finish(mut self) -> Result<Encoded, Full> {
        let length = self.bytes.len() - BEFORE_INSTRUCTION + CRC_BYTES;
        let length = u16::try_from(length).map_err(|_| Full)?;
        if let Some(field) = self.bytes.get_mut(5..BEFORE_INSTRUCTION) {
            field.copy_from_slice(&length.to_le_bytes());
        }
        let crc = crc16(0, &self.bytes);
        self.bytes.extend_from_slice(&crc.to_le_bytes()).map_err(|_| Full)?;
        Ok(self.bytes)
    }
}

/// Takes the stuffing out of `bytes` (instruction and parameters) in place; how many bytes are left.
pub(crate) fn unstuff(bytes: &mut [u8]) -> usize {
    let mut kept = 0;
    let mut latest = [0; TO_STUFF.len()];
    for read in 0..bytes.len() {
        let Some(&byte) = bytes.get(read) else { break };
        if latest != TO_STUFF || byte != STUFFING {
            if let Some(place) = bytes.get_mut(kept) {
                *place = byte;
            }
            kept += 1;
        }
        let [_, b, c] = latest;
        latest = [b, c, byte];
    }
    kept
}
