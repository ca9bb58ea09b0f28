//! Datagrams of the TMC2209 on its serial line (datasheet rev. 1.09, sections 4.1 and 4.2).
//!
//! ```text
//! write    05 | address | 80 + register | value, 4 bytes, highest first | CRC
//! request  05 | address | register | CRC
//! reply    05 | FF | register | value, 4 bytes, highest first | CRC
//! ```

use heapless::Vec;

use super::registers::Register;

/// Number of drivers that one line can tell apart: their pins MS1 and MS2 set the address.
pub const ADDRESSES: usize = 4;
/// Length of a write and of a reply in bytes; a request is shorter.
pub const LONGEST: usize = 8;

const SYNC: u8 = 0x05;
/// Address of the board in replies.
const BOARD: u8 = 0xFF;
const WRITE: u8 = 0x80;

/// Bytes for the line.
pub type Datagram = Vec<u8, LONGEST>;

/// The datagram that writes `value` to a register of the driver with this address.
///
/// ```
/// use vergence_control::driver::{Register, write};
///
/// assert_eq!(write(0, Register::ChopConf, 0x1000_0053), [0x05, 0x00, 0xEC, 0x10, 0x00, 0x00, 0x53, 0x9C]);
/// ```
#[must_use]
pub fn write(address: u8, register: Register, value: u32) -> Datagram {
    let [a, b, c, d] = value.to_be_bytes();
    closed(&[SYNC, address, register as u8 | WRITE, a, b, c, d])
}

/// The datagram that asks for a register of the driver with this address.
///
/// ```
/// use vergence_control::driver::{Register, request};
///
/// assert_eq!(request(0, Register::GConf), [0x05, 0x00, 0x00, 0x48]);
/// ```
#[must_use]
pub fn request(address: u8, register: Register) -> Datagram {
    closed(&[SYNC, address, register as u8])
}

/// The value in a reply about `register`; `None` if the bytes are no such reply.
#[must_use]
pub fn value_of(reply: &[u8], register: Register) -> Option<u32> {
    let [SYNC, BOARD, about, value @ .., crc] = reply else { return None };
    let value = <[u8; 4]>::try_from(value).ok()?;
    let sound = *about == register as u8 && *crc == checksum(&reply[..LONGEST - 1]);
    sound.then_some(u32::from_be_bytes(value))
}

fn closed(bytes: &[u8]) -> Datagram {
    bytes.iter().copied().chain([checksum(bytes)]).collect()
}

/// CRC-8 with the polynomial x⁸ + x² + x + 1, bytes from their lowest bit on (section 4.2).
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc, |crc: u8, bit| {
            let differs = (crc >> 7) ^ (byte >> bit & 1) == 1;
            crc << 1 ^ if differs { 0x07 } else { 0 }
        })
    })
}
