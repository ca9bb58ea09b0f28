//! Which peripheral is at an address, and which registers it has.

use std::sync::Arc;

use crate::unit::{UNITS, Unit};
use crate::units::Units;

/// Peripherals of APB1, APB2 and AHB1, a kilobyte each.
const LOW: u32 = 0x4000_0000;
const LOW_PAGES: usize = 0x90;
/// Registers of a peripheral lie below this.
const EXTENT: u32 = 0x100;

/// A table from address to peripheral; the same for every chip.
#[derive(Clone, Debug)]
pub(crate) struct Directory {
    pages: Arc<[Option<Unit>; LOW_PAGES]>,
    /// A bit for each word that is a register.
    registers: Arc<[u64; UNITS]>,
}

impl Directory {
    pub fn new(units: &mut Units) -> Self {
        let mut pages = [None; LOW_PAGES];
        let mut registers = [0u64; UNITS];
        for (index, words) in registers.iter_mut().enumerate() {
            let unit = Unit::at(index);
            if let Some(page) = pages.get_mut((unit.base().wrapping_sub(LOW) >> 10) as usize) {
                *page = Some(unit);
            }
            let offsets = units.get(unit).registers().iter().filter(|(offset, _)| *offset < EXTENT);
            *words = offsets.fold(0, |all, (offset, _)| all | 1u64 << (offset / 4));
        }
        Self { pages: Arc::new(pages), registers: Arc::new(registers) }
    }

    /// The peripheral whose kilobyte an address is in.
    pub fn unit_at(&self, address: u32) -> Option<Unit> {
        let page = address >> 10;
        if let Some(unit) = self.pages.get(page.wrapping_sub(LOW >> 10) as usize) {
            return *unit;
        }
        match page.wrapping_sub(Unit::Gpio(0).base() >> 10) {
            port @ 0..7 => Some(Unit::Gpio(port as u8)),
            _ => [Unit::Rng, Unit::Debug].into_iter().find(|unit| unit.base() >> 10 == page),
        }
    }

    pub fn has_register(&self, unit: Unit, offset: u32) -> bool {
        offset < EXTENT && self.registers[unit.index()] >> (offset / 4) & 1 == 1
    }
}
