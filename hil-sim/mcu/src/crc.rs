//! CRC: the checksum unit (RM0440 §16).

use vergence_cpu::Access;

use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};

const DR: u32 = 0x00;
const IDR: u32 = 0x04;
const CR: u32 = 0x08;
const INIT: u32 = 0x10;
const POL: u32 = 0x14;

/// The checksum unit.
#[derive(Clone, Debug)]
pub(crate) struct Crc {
    remainder: u32,
    idr: u32,
    cr: u32,
    init: u32,
    polynomial: u32,
    /// The width of the next write to DR.
    pub access: Access,
}

impl Default for Crc {
    fn default() -> Self {
        Self { remainder: u32::MAX, idr: 0, cr: 0, init: u32::MAX, polynomial: 0x04C1_1DB7, access: Access::Word }
    }
}

impl Crc {
    /// Bits of the polynomial (CR.POLYSIZE).
    fn width(&self) -> u32 {
        [32, 16, 8, 7][(self.cr >> 3 & 3) as usize]
    }

    /// CR.REV_IN: reverses bits within each byte, half-word or word of what was written.
    fn reversed_input(&self, value: u32, bits: u32) -> u32 {
        let piece = match self.cr >> 5 & 3 {
            0 => return value,
            1 => 8,
            2 => 16.min(bits),
            _ => bits,
        };
        let mask = u32::MAX >> (32 - piece);
        (0..bits).step_by(piece as usize).fold(0, |all, low| {
            let reversed = (value >> low & mask).reverse_bits() >> (32 - piece);
            all | reversed << low
        })
    }

    fn feed(&mut self, value: u32, bits: u32) {
        let width = self.width();
        let top = 1u32 << (width - 1);
        let value = self.reversed_input(value, bits);
        for bit in (0..bits).rev() {
            let carries = (self.remainder & top != 0) != (value >> bit & 1 == 1);
            self.remainder = self.remainder << 1 ^ if carries { self.polynomial } else { 0 };
        }
        self.remainder &= u32::MAX >> (32 - width);
    }

    fn result(&self) -> u32 {
        let width = self.width();
        if self.cr >> 7 & 1 == 1 { self.remainder.reverse_bits() >> (32 - width) } else { self.remainder }
    }
}

impl Peripheral for Crc {
    fn registers(&self) -> Registers {
        &[(DR, "DR"), (IDR, "IDR"), (CR, "CR"), (INIT, "INIT"), (POL, "POL")]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            DR => self.result(),
            IDR => self.idr,
            CR => self.cr,
            INIT => self.init,
            _ => self.polynomial,
        })
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            DR => self.feed(value, 8 * crate::memory::bytes(self.access) as u32),
            IDR => self.idr = value,
            CR => {
                only(value, 0xF9)?;
                self.cr = value & 0xF8;
                if value & 1 == 1 {
                    self.remainder = self.init & (u32::MAX >> (32 - self.width()));
                }
            }
            INIT => {
                self.init = value;
                self.remainder = value;
            }
            _ => self.polynomial = value,
        }
        Ok(())
    }
}
