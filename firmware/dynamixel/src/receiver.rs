//! Bytes from the wire into packets.

use heapless::Vec;

use crate::builder::{BEFORE_INSTRUCTION, CRC_BYTES, HEADER, MAX_PACKET, unstuff};
use crate::crc::crc16;
use crate::id::Id;
use crate::instruction::InstructionCode;

/// A packet whose CRC is right, without its stuffing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// Whom it is for, or who answers.
    pub id: Id,
    /// The instruction byte; 0x55 is an answer.
    pub instruction: u8,
    /// What follows the instruction byte. Of an answer the error byte is the first.
    pub parameters: &'a [u8],
}

/// What was heard beside good packets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Packets with a wrong CRC.
    pub crc_errors: u32,
    /// Bytes that belonged to no packet.
    pub strays: u32,
}

/// Finds packets in a stream of bytes, however it is cut, and finds them again after bytes that belong to none.
///
/// A header in garbage can claim bytes of a good packet that follows it. When the claimed packet proves wrong, only its
/// first byte is given up and the search goes on behind it, so the good packet is found. A packet whose end never comes
/// keeps the receiver waiting: tell it with [`Receiver::line_is_quiet`] when nothing more can come.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    bytes: Vec<u8, MAX_PACKET>,
    /// Bytes at the front of `bytes` that were yielded as a packet.
    yielded: usize,
    counters: Counters,
}

/// What stands at the front of the buffer.
enum Front {
    /// The beginning of a packet, or nothing.
    Incomplete,
    /// A packet of this many bytes.
    Packet(usize),
    /// No packet: give up the first byte.
    Stray,
    /// A packet with a wrong CRC: give up the first byte.
    WrongCrc,
}

impl Receiver {
    /// Takes bytes, and returns those that do not fit: take the packets with [`Self::next_packet`], then offer them again. A
    /// full buffer always holds a packet or bytes that belong to none, so this comes to an end.
    pub fn hear<'b>(&mut self, bytes: &'b [u8]) -> &'b [u8] {
        self.forget_yielded();
        let room = (MAX_PACKET - self.bytes.len()).min(bytes.len());
        let (taken, rest) = bytes.split_at(room);
        // It fits: `room` is what is left.
        let _ = self.bytes.extend_from_slice(taken);
        rest
    }

    /// The next whole packet, if there is one.
    pub fn next_packet(&mut self) -> Option<Packet<'_>> {
        self.forget_yielded();
        let total = loop {
            match self.front() {
                Front::Incomplete => return None,
                Front::Packet(total) => break total,
                Front::Stray => self.give_up_to_next_header(),
                Front::WrongCrc => {
                    self.counters.crc_errors = self.counters.crc_errors.saturating_add(1);
                    self.give_up_to_next_header();
                }
            }
        };
        self.yielded = total;
        let (head, body) = self.bytes.split_at_mut_checked(BEFORE_INSTRUCTION)?;
        let id = Id::of_wire(*head.get(4)?)?;
        let body = body.get_mut(..total - BEFORE_INSTRUCTION - CRC_BYTES)?;
        let combined = id == Id::BROADCAST && body.first() == Some(&(InstructionCode::Status as u8));
        let length = if combined { body.len() } else { unstuff(body) };
        let (instruction, parameters) = body.get(..length)?.split_first()?;
        Some(Packet { id, instruction: *instruction, parameters })
    }

    /// Nothing more can come: what looked like the beginning of a packet is none. Packets inside it are found by the next
    /// calls of [`Self::next_packet`].
    pub fn line_is_quiet(&mut self) {
        self.forget_yielded();
        while matches!(self.front(), Front::Incomplete) && !self.bytes.is_empty() {
            self.give_up_to_next_header();
        }
    }

    /// Forgets everything heard, such as before a question is sent.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.yielded = 0;
    }

    /// What was heard beside good packets since the start.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    fn front(&self) -> Front {
        let compared = self.bytes.iter().zip(HEADER).all(|(byte, header)| *byte == header);
        if !compared {
            return Front::Stray;
        }
        let [_, _, _, _, id, low, high, ..] = *self.bytes else { return Front::Incomplete };
        let length = usize::from(u16::from_le_bytes([low, high]));
        let total = BEFORE_INSTRUCTION + length;
        if Id::of_wire(id).is_none() || length < 1 + CRC_BYTES || total > MAX_PACKET {
            return Front::Stray;
        }
        let Some(packet) = self.bytes.get(..total) else { return Front::Incomplete };
        let (covered, crc) = packet.split_at(total - CRC_BYTES);
        if crc == crc16(0, covered).to_le_bytes() { Front::Packet(total) } else { Front::WrongCrc }
    }

    /// Drops the first byte, and those after it that cannot begin a header.
    fn give_up_to_next_header(&mut self) {
        let rest = self.bytes.get(1..).unwrap_or_default();
        let next = rest.iter().position(|byte| *byte == 0xFF).unwrap_or(rest.len());
        self.counters.strays = self.counters.strays.saturating_add(u32::try_from(next + 1).unwrap_or(u32::MAX));
        self.drop_front(next + 1);
    }

    fn forget_yielded(&mut self) {
        let yielded = core::mem::take(&mut self.yielded);
        self.drop_front(yielded);
    }

    fn drop_front(&mut self, count: usize) {
        let length = self.bytes.len();
        let count = count.min(length);
        self.bytes.copy_within(count.., 0);
        self.bytes.truncate(length - count);
        self.yielded = self.yielded.saturating_sub(count);
    }
}
