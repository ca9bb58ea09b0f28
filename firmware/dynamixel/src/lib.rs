//! Dynamixel Protocol 2.0, as bus servos speak it on one half-duplex wire, and the control table of the X series (`no_std`,
//! no allocation, no device).
//!
//! A packet is `FF FF FD 00 | id | length | instruction | parameters | CRC-16`, numbers little-endian. `length` counts the bytes
//! after itself. Source: ROBOTIS e-manual, *DYNAMIXEL Protocol 2.0* (emanual.robotis.com/docs/en/dxl/protocol2).
//!
//! - The master makes [`Encoded`] packets with [`encode`], the servo with [`answer`].
//! - Both ends feed what they hear to a [`Receiver`], which yields each [`Packet`]. The servo reads it as an [`Instruction`], the
//!   master as a [`Status`], or as [`FastBlocks`], the one answer of several servos to a fast read.
//! - [`table`] has the registers, [`units`] what their numbers mean.
//!
//! ```
//! use vergence_dynamixel::{Id, Instruction, Receiver, Status, answer, encode, table};
//!
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! let id = Id::servo(1)?;
//! let question = encode::read(id, table::PRESENT_POSITION.address, table::PRESENT_POSITION.width)?;
//! let mut servo = Receiver::default();
//! servo.hear(&question);
//! let heard = servo.next_packet().ok_or("a packet")?;
//! assert_eq!(Instruction::of(&heard)?, Instruction::Read { address: 132, length: 4 });
//!
//! let answer = answer::status(id, 0, &166_i32.to_le_bytes())?;
//! let mut master = Receiver::default();
//! master.hear(&answer);
//! let status = Status::of(&master.next_packet().ok_or("a packet")?)?;
//! assert_eq!((status.id, status.error, status.data), (id, None, &[166, 0, 0, 0][..]));
//! # Ok(())
//! # }
//! ```

#![no_std]

pub mod answer;
mod builder;
mod crc;
pub mod encode;
mod fast;
mod id;
mod instruction;
mod receiver;
mod status;
pub mod table;
pub mod units;

pub use builder::{Encoded, Full, MAX_PACKET};
pub use crc::crc16;
pub use fast::{FastBlock, FastBlocks, FastError};
pub use id::{Id, NotAnId};
pub use instruction::{BulkItem, Instruction, InstructionCode, Malformed, ResetScope, SyncItem};
pub use receiver::{Counters, Packet, Receiver};
pub use status::{NotAStatus, PingInfo, Status, StatusError};
