//! The one answer of several servos to a fast read.
//!
//! Each servo appends `error | id | data | CRC` as soon as it has heard the bytes of the one before it. Every CRC covers the
//! packet from its header to there. Nothing is stuffed (e-manual, "Fast Sync Read"), so data can look like a header.

use thiserror::Error;

use crate::builder::{BEFORE_INSTRUCTION, CRC_BYTES, HEADER};
use crate::crc::crc16;
use crate::id::Id;
use crate::instruction::InstructionCode;
use crate::receiver::Packet;
use crate::status::{ALERT, StatusError};

/// What one servo put into a combined answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FastBlock<'a> {
    /// Who answers.
    pub id: Id,
    /// Whether the servo has a hardware error.
    pub alert: bool,
    /// Why the servo did not read.
    pub error: Option<StatusError>,
    /// The registers.
    pub data: &'a [u8],
}

/// Why a combined answer is not understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FastError {
    /// The packet is something else.
    #[error("the packet is not the combined answer of several servos")]
    NotCombined,
    /// Another length than asked for.
    #[error("the combined answer has another length than was asked for")]
    Length,
    /// A block is not of the servo whose turn it was.
    #[error("block {place} of the combined answer is not of the servo whose turn it was")]
    Id {
        /// Number of the block, from 0.
        place: usize,
    },
    /// A block's own CRC is wrong.
    #[error("block {place} of the combined answer has a wrong CRC")]
    Crc {
        /// Number of the block, from 0.
        place: usize,
    },
}

/// The blocks of a combined answer, in the order of the question.
#[derive(Clone, Copy, Debug)]
pub struct FastBlocks<'a, 'e> {
    rest: &'a [u8],
    expected: &'e [(Id, u16)],
    crc: u16,
    place: usize,
}

/// Bytes around the data of a block: error and id before, CRC after.
pub(crate) const AROUND_DATA: usize = 2 + CRC_BYTES;

/// The value of the length field of a combined answer with data of these lengths: the instruction byte and all blocks.
pub(crate) fn length_field(lengths: impl Iterator<Item = u16>) -> usize {
    1 + lengths.map(|length| usize::from(length) + AROUND_DATA).sum::<usize>()
}

/// The bytes before the first block.
pub(crate) fn beginning(length: u16) -> [u8; BEFORE_INSTRUCTION + 1] {
    let [a, b, c, d] = HEADER;
    let [low, high] = length.to_le_bytes();
    [a, b, c, d, Id::BROADCAST.get(), low, high, InstructionCode::Status as u8]
}

impl<'a, 'e> FastBlocks<'a, 'e> {
    /// Reads a packet as the answer to a question for `expected`: servos and how many bytes of each, in the order asked.
    ///
    /// # Errors
    /// [`FastError::NotCombined`] and [`FastError::Length`]. Wrong blocks are told when they are reached.
    pub fn of(packet: &Packet<'a>, expected: &'e [(Id, u16)]) -> Result<Self, FastError> {
        if packet.instruction != InstructionCode::Status as u8 || packet.id != Id::BROADCAST {
            return Err(FastError::NotCombined);
        }
        let length = length_field(expected.iter().map(|(_, length)| *length));
        // The CRC of the last block is that of the packet, which the receiver has checked and keeps behind the parameters.
        let stated = packet.parameters.len() + 1 + CRC_BYTES;
        if stated != length {
            return Err(FastError::Length);
        }
        let length = u16::try_from(length).map_err(|_| FastError::Length)?;
        Ok(Self { rest: packet.parameters, expected, crc: crc16(0, &beginning(length)), place: 0 })
    }

    fn block(&mut self, expected: Id, length: u16, last: bool) -> Result<FastBlock<'a>, FastError> {
        let place = self.place;
        let size = usize::from(length) + 2;
        let (block, rest) = self.rest.split_at_checked(size).ok_or(FastError::Length)?;
        self.crc = crc16(self.crc, block);
        if !last {
            let (stated, rest) = rest.split_at_checked(CRC_BYTES).ok_or(FastError::Length)?;
            if stated != self.crc.to_le_bytes() {
                return Err(FastError::Crc { place });
            }
            self.crc = crc16(self.crc, stated);
            self.rest = rest;
        }
        let [error, id, data @ ..] = block else { return Err(FastError::Length) };
        if *id != expected.get() {
            return Err(FastError::Id { place });
        }
        Ok(FastBlock { id: expected, alert: error & ALERT != 0, error: StatusError::of_byte(*error), data })
    }
}

impl<'a> Iterator for FastBlocks<'a, '_> {
    type Item = Result<FastBlock<'a>, FastError>;

    /// The next block; nothing after the last one or after one that is wrong.
    fn next(&mut self) -> Option<Self::Item> {
        let &(id, length) = self.expected.get(self.place)?;
        let last = self.place + 1 == self.expected.len();
        let block = self.block(id, length, last);
        self.place = if block.is_ok() { self.place + 1 } else { self.expected.len() };
        Some(block)
    }
}
