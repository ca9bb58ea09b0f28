//! What the master asks for, as a servo reads it.

use thiserror::Error;

use crate::id::Id;
use crate::receiver::Packet;

/// The instruction byte of a packet (e-manual, "Instruction").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum InstructionCode {
    /// Is the servo there?
    Ping = 0x01,
    /// Read of registers.
    Read = 0x02,
    /// Write of registers.
    Write = 0x03,
    /// Write that waits for `Action`.
    RegWrite = 0x04,
    /// Carries out the write that waits.
    Action = 0x05,
    /// Back to the values of the factory.
    FactoryReset = 0x06,
    /// Starts the servo anew; clears hardware errors.
    Reboot = 0x08,
    /// Forgets whole turns of the position.
    Clear = 0x10,
    /// An answer.
    Status = 0x55,
    /// The same registers of several servos, an answer each.
    SyncRead = 0x82,
    /// The same registers of several servos; no answer.
    SyncWrite = 0x83,
    /// As `SyncRead`, with one answer of all.
    FastSyncRead = 0x8A,
    /// Different registers of several servos, an answer each.
    BulkRead = 0x92,
    /// Different registers of several servos; no answer.
    BulkWrite = 0x93,
    /// As `BulkRead`, with one answer of all.
    FastBulkRead = 0x9A,
}

/// What a factory reset leaves as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ResetScope {
    /// Nothing. Servos refuse it as a broadcast.
    All = 0xFF,
    /// The number.
    ExceptId = 0x01,
    /// Number and speed of the line.
    ExceptIdAndBaud = 0x02,
}

/// The fixed parameters of `Clear` that make it forget whole turns.
pub(crate) const CLEAR_TURNS: [u8; 5] = [0x01, 0x44, 0x58, 0x4C, 0x22];

/// An instruction with its parameters. Addresses and lengths count bytes of the control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instruction<'a> {
    /// Is the servo there?
    Ping,
    /// Read of `length` bytes.
    Read {
        /// First register.
        address: u16,
        /// Bytes.
        length: u16,
    },
    /// Write of `data`.
    Write {
        /// First register.
        address: u16,
        /// The bytes.
        data: &'a [u8],
    },
    /// Write of `data` at the next `Action`.
    RegWrite {
        /// First register.
        address: u16,
        /// The bytes.
        data: &'a [u8],
    },
    /// Carries out the write that waits.
    Action,
    /// Back to the values of the factory.
    FactoryReset(ResetScope),
    /// Starts the servo anew.
    Reboot,
    /// Forgets whole turns of the position.
    ClearTurns,
    /// Read of the same registers of several servos.
    SyncRead {
        /// First register.
        address: u16,
        /// Bytes of each servo.
        length: u16,
        /// The servos, in the order of their answers.
        ids: &'a [u8],
        /// Whether all answer in one packet.
        fast: bool,
    },
    /// Write of the same registers of several servos.
    SyncWrite {
        /// First register.
        address: u16,
        /// Bytes for each servo.
        length: u16,
        /// A number and `length` bytes for each servo: see [`Instruction::sync_items`].
        items: &'a [u8],
    },
    /// Read of different registers of several servos.
    BulkRead {
        /// Number, address and length for each servo, five bytes: see [`Instruction::bulk_reads`].
        items: &'a [u8],
        /// Whether all answer in one packet.
        fast: bool,
    },
    /// Write of different registers of several servos.
    BulkWrite {
        /// Number, address, length and bytes for each servo: see [`Instruction::bulk_writes`].
        items: &'a [u8],
    },
}

/// What a `SyncWrite` has for one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncItem<'a> {
    /// The servo's number.
    pub id: u8,
    /// The bytes.
    pub data: &'a [u8],
}

/// What a bulk instruction has for one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BulkItem<'a> {
    /// The servo's number.
    pub id: u8,
    /// First register.
    pub address: u16,
    /// Bytes to read or write.
    pub length: u16,
    /// The bytes of a write; of a read, none.
    pub data: &'a [u8],
}

/// Why a packet is no instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Malformed {
    /// The packet is an answer.
    #[error("the packet is an answer, not an instruction")]
    IsStatus,
    /// No instruction has this byte.
    #[error("no instruction has the code {0:#04x}")]
    Unknown(u8),
    /// The parameters are too short, too long or have a value that the instruction does not know.
    #[error("the parameters do not fit the instruction {0:#04x}")]
    Parameters(u8),
}

impl<'a> Instruction<'a> {
    /// Reads a packet as an instruction.
    ///
    /// # Errors
    /// [`Malformed`], where it is none or its parameters have another length than it needs.
    pub fn of(packet: &Packet<'a>) -> Result<Self, Malformed> {
        let code = packet.instruction;
        let bad = Malformed::Parameters(code);
        let all = packet.parameters;
        match code {
            0x01 => nothing(all, Self::Ping, bad),
            0x02 => match all {
                [a, b, c, d] => Ok(Self::Read { address: word(*a, *b), length: word(*c, *d) }),
                _ => Err(bad),
            },
            0x03 => addressed(all).map(|(address, data)| Self::Write { address, data }).ok_or(bad),
            0x04 => addressed(all).map(|(address, data)| Self::RegWrite { address, data }).ok_or(bad),
            0x05 => nothing(all, Self::Action, bad),
            0x06 => match all {
                [0xFF] => Ok(Self::FactoryReset(ResetScope::All)),
                [0x01] => Ok(Self::FactoryReset(ResetScope::ExceptId)),
                [0x02] => Ok(Self::FactoryReset(ResetScope::ExceptIdAndBaud)),
                _ => Err(bad),
            },
            0x08 => nothing(all, Self::Reboot, bad),
            0x10 if all == CLEAR_TURNS => Ok(Self::ClearTurns),
            0x10 => Err(bad),
            0x55 => Err(Malformed::IsStatus),
            0x82 | 0x8A => match all {
                [a, b, c, d, ids @ ..] if !ids.is_empty() => {
                    Ok(Self::SyncRead { address: word(*a, *b), length: word(*c, *d), ids, fast: code == 0x8A })
                }
                _ => Err(bad),
            },
            0x83 => match all {
                [a, b, c, d, items @ ..] => {
                    let length = word(*c, *d);
                    let whole = items.len() % (usize::from(length) + 1) == 0;
                    if !whole || items.is_empty() || length == 0 {
                        return Err(bad);
                    }
                    Ok(Self::SyncWrite { address: word(*a, *b), length, items })
                }
                _ => Err(bad),
            },
            0x92 | 0x9A if !all.is_empty() && all.len().is_multiple_of(5) => {
                Ok(Self::BulkRead { items: all, fast: code == 0x9A })
            }
            0x93 if !all.is_empty() && Writes(all).last_is_whole() => Ok(Self::BulkWrite { items: all }),
            0x92 | 0x93 | 0x9A => Err(bad),
            unknown => Err(Malformed::Unknown(unknown)),
        }
    }

    /// What a `SyncWrite` has for each servo; nothing for another instruction.
    pub fn sync_items(&self) -> impl Iterator<Item = SyncItem<'a>> + use<'a> {
        let (items, length) = match *self {
            Self::SyncWrite { items, length, .. } => (items, usize::from(length)),
            _ => (&[][..], 0),
        };
        items.chunks_exact(length + 1).filter_map(|item| match item {
            [id, data @ ..] => Some(SyncItem { id: *id, data }),
            [] => None,
        })
    }

    /// What a `BulkRead` asks of each servo; nothing for another instruction.
    pub fn bulk_reads(&self) -> impl Iterator<Item = BulkItem<'a>> + use<'a> {
        let items = if let Self::BulkRead { items, .. } = *self { items } else { &[] };
        items.chunks_exact(5).filter_map(|item| match item {
            [id, a, b, c, d] => Some(BulkItem { id: *id, address: word(*a, *b), length: word(*c, *d), data: &[] }),
            _ => None,
        })
    }

    /// What a `BulkWrite` has for each servo; nothing for another instruction.
    pub fn bulk_writes(&self) -> impl Iterator<Item = BulkItem<'a>> + use<'a> {
        Writes(if let Self::BulkWrite { items } = *self { items } else { &[] })
    }
}

/// The items of a `BulkWrite`, whose lengths differ. Ends early at an item that is cut.
struct Writes<'a>(&'a [u8]);

impl Writes<'_> {
    fn last_is_whole(mut self) -> bool {
        while self.next().is_some() {}
        self.0.is_empty()
    }
}

impl<'a> Iterator for Writes<'a> {
    type Item = BulkItem<'a>;

    fn next(&mut self) -> Option<BulkItem<'a>> {
        let [id, a, b, c, d, rest @ ..] = self.0 else { return None };
        let length = word(*c, *d);
        let (data, rest) = rest.split_at_checked(usize::from(length))?;
        self.0 = rest;
        Some(BulkItem { id: *id, address: word(*a, *b), length, data })
    }
}

fn word(low: u8, high: u8) -> u16 {
    u16::from_le_bytes([low, high])
}

fn addressed(parameters: &[u8]) -> Option<(u16, &[u8])> {
    match parameters {
        [a, b, data @ ..] if !data.is_empty() => Some((word(*a, *b), data)),
        _ => None,
    }
}

fn nothing<'a>(parameters: &[u8], it: Instruction<'a>, bad: Malformed) -> Result<Instruction<'a>, Malformed> {
    if parameters.is_empty() { Ok(it) } else { Err(bad) }
}

impl Packet<'_> {
    /// Whether the packet is for this servo: by its number or as a broadcast.
    #[must_use]
    pub fn is_for(&self, servo: Id) -> bool {
        self.id == servo || self.id == Id::BROADCAST
    }
}
