//! GPIO: the registers of one port (RM0440 §9). Levels are found by `pads`.

use crate::peripheral::{Moment, Peripheral, Registers, Reply};

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const OSPEEDR: u32 = 0x08;
const PUPDR: u32 = 0x0C;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;
const AFRH: u32 = 0x24;
const BRR: u32 = 0x28;

/// Mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Input,
    Output,
    Alternate(u8),
    Analog,
}

/// One port.
#[derive(Clone, Debug)]
pub(crate) struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    afr: [u32; 2],
    /// Levels of the pins, found by the pads.
    pub levels: u16,
    /// Whether some pin may have another level or connection than before.
    pub changed: bool,
}

impl Port {
    /// Reset values (§9.4): the debug pins PA13 to PA15, PB3 and PB4 are in use.
    pub fn new(number: u8) -> Self {
        let (moder, ospeedr, pupdr) = match number {
            0 => (0xABFF_FFFF, 0x0C00_0000, 0x6400_0000),
            1 => (0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100),
            _ => (0xFFFF_FFFF, 0, 0),
        };
        Self { moder, otyper: 0, ospeedr, pupdr, odr: 0, afr: [0; 2], levels: 0, changed: true }
    }

    pub fn mode(&self, number: usize) -> Mode {
        match self.moder >> (2 * number) & 3 {
            0 => Mode::Input,
            1 => Mode::Output,
            2 => Mode::Alternate((self.afr[number / 8] >> (4 * (number % 8)) & 0xF) as u8),
            _ => Mode::Analog,
        }
    }

    pub fn output(&self, number: usize) -> bool {
        self.odr >> number & 1 == 1
    }

    pub fn is_open_drain(&self, number: usize) -> bool {
        self.otyper >> number & 1 == 1
    }

    /// The level that the pull resistor gives a floating pin; without one it reads low.
    pub fn pulled(&self, number: usize) -> bool {
        self.pupdr >> (2 * number) & 3 == 1
    }
}

impl Peripheral for Port {
    fn registers(&self) -> Registers {
        &[
            (MODER, "MODER"),
            (OTYPER, "OTYPER"),
            (OSPEEDR, "OSPEEDR"),
            (PUPDR, "PUPDR"),
            (IDR, "IDR"),
            (ODR, "ODR"),
            (BSRR, "BSRR"),
            (AFRL, "AFRL"),
            (AFRH, "AFRH"),
            (BRR, "BRR"),
        ]
    }

    fn reads_quietly(&self, _offset: u32) -> bool {
        true
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            MODER => self.moder,
            OTYPER => self.otyper,
            OSPEEDR => self.ospeedr,
            PUPDR => self.pupdr,
            // The input stage of an analog pin is off and reads low (§9.3.12).
            IDR => (0..16)
                .filter(|&number| self.mode(number) != Mode::Analog)
                .fold(0, |all, number| all | u32::from(self.levels) & 1 << number),
            ODR => self.odr,
            AFRL => self.afr[0],
            AFRH => self.afr[1],
            _ => 0,
        })
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            MODER => self.moder = value,
            OTYPER => self.otyper = value & 0xFFFF,
            OSPEEDR => self.ospeedr = value,
            PUPDR => self.pupdr = value,
            ODR => self.odr = value & 0xFFFF,
            // Setting wins over resetting (§9.4.7).
            BSRR => self.odr = self.odr & !(value >> 16) | value & 0xFFFF,
            AFRL => self.afr[0] = value,
            AFRH => self.afr[1] = value,
            BRR => self.odr &= !(value & 0xFFFF),
            _ => {}
        }
        self.changed = true;
        Ok(())
    }
}
