//! Packets that a servo sends.

use heapless::Vec;

use crate::builder::{Builder, Encoded, Full, MAX_PACKET};
use crate::crc::crc16;
use crate::fast::{beginning, length_field};
use crate::id::Id;
use crate::instruction::InstructionCode;

/// The answer of one servo: its error byte, with the alert as bit 7, and what was asked for.
///
/// # Errors
/// [`Full`], if the data do not fit into a packet.
pub fn status(id: Id, error: u8, data: &[u8]) -> Result<Encoded, Full> {
    let mut packet = Builder::new(id, InstructionCode::Status as u8)?;
    packet.push(error)?;
    packet.extend(data)?;
    packet.finish()
}

/// The part of a combined answer that one servo sends.
#[derive(Clone, Copy, Debug)]
pub struct FastPart<'a> {
    /// How many bytes each servo was asked for, in the order asked.
    pub lengths: &'a [u16],
    /// Whose turn it is, from 0.
    pub place: usize,
    /// The bytes of the packet that the servos before it have sent; empty for the first.
    pub before: &'a [u8],
    /// The servo.
    pub id: Id,
    /// Its error byte, with the alert as bit 7.
    pub error: u8,
    /// The registers.
    pub data: &'a [u8],
}

impl FastPart<'_> {
    /// The bytes to send. The first servo sends header and length for all.
    ///
    /// # Errors
    /// [`Full`], if the whole answer does not fit into a packet.
    pub fn encode(&self) -> Result<Encoded, Full> {
        let length = length_field(self.lengths.iter().copied());
        if length + 7 > MAX_PACKET {
            return Err(Full);
        }
        let mut bytes: Encoded = Vec::new();
        if self.place == 0 {
            let length = u16::try_from(length).map_err(|_| Full)?;
            bytes.extend_from_slice(&beginning(length)).map_err(|_| Full)?;
        }
        bytes.extend_from_slice(&[self.error, self.id.get()]).map_err(|_| Full)?;
        bytes.extend_from_slice(self.data).map_err(|_| Full)?;
        let crc = crc16(crc16(0, self.before), &bytes);
        bytes.extend_from_slice(&crc.to_le_bytes()).map_err(|_| Full)?;
        Ok(bytes)
    }
}
