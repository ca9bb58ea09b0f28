//! Memories and their addresses (RM0440 §2.2.2 and §2.4): flash at `0x0800_0000` and 0, SRAM1, SRAM2 and CCM SRAM at
//! `0x2000_0000`, CCM SRAM also at `0x1000_0000`.

use std::cell::Cell;

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_cpu::Access;

/// Size of flash in bytes.
pub const FLASH_SIZE: usize = 512 * 1024;
/// Address of flash.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Address of the first SRAM.
pub const RAM_BASE: u32 = 0x2000_0000;
/// Size of all SRAMs in bytes: 80 KiB + 16 KiB + 32 KiB of CCM.
pub const RAM_SIZE: usize = 128 * 1024;

const CCM_BASE: u32 = 0x1000_0000;
const CCM_OFFSET: u32 = 96 * 1024;
const SYSTEM_BASE: u32 = 0x1FFF_7000;
const OPTION_BASE: u32 = 0x1FFF_7800;

/// A place in one of the memories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Flash(usize),
    Ram(usize),
    /// Read-only words of the factory and the option bytes.
    System(u32),
}

/// Contents of flash and RAM.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    pub flash: Vec<u8>,
    pub ram: Vec<u8>,
    /// The 96 bits of the unique device identifier.
    pub uid: [u32; 3],
    /// Pieces of RAM, 2 KiB each, that code was fetched from: after a write by DMA the core must decode them again.
    fetched: Cell<u64>,
}

impl Memory {
    pub fn new(uid: [u32; 3], seed: u64) -> Self {
        let mut memory = Self { flash: vec![0xFF; FLASH_SIZE], ram: vec![0; RAM_SIZE], uid, fetched: Cell::new(0) };
        memory.lose_power(seed);
        memory
    }

    /// Fills RAM with noise as at power-on, the same for the same seed.
    pub fn lose_power(&mut self, seed: u64) {
        Pcg64Mcg::seed_from_u64(seed).fill_bytes(&mut self.ram);
        self.fetched.set(0);
    }

    /// The memory at `address`; `None` for peripherals and gaps.
    #[inline]
    pub fn place(address: u32) -> Option<Place> {
        const FLASH_END: u32 = FLASH_BASE + FLASH_SIZE as u32;
        const RAM_END: u32 = RAM_BASE + RAM_SIZE as u32;
        match address {
            RAM_BASE..RAM_END => Some(Place::Ram((address - RAM_BASE) as usize)),
            FLASH_BASE..FLASH_END => Some(Place::Flash((address - FLASH_BASE) as usize)),
            0..0x8_0000 => Some(Place::Flash(address as usize)),
            CCM_BASE..0x1000_8000 => Some(Place::Ram((address - CCM_BASE + CCM_OFFSET) as usize)),
            SYSTEM_BASE..0x1FFF_8000 | 0x1FFF_F800..0x2000_0000 => Some(Place::System(address)),
            _ => None,
        }
    }

    #[inline]
    pub fn read_ram(&self, offset: usize, access: Access) -> Option<u32> {
        load(&self.ram, offset, access)
    }

    #[inline]
    pub fn read_flash(&self, offset: usize, access: Access) -> Option<u32> {
        load(&self.flash, offset, access)
    }

    #[inline]
    pub fn write_ram(&mut self, offset: usize, access: Access, value: u32) -> Option<()> {
        match access {
            Access::Byte => *self.ram.get_mut(offset)? = value as u8,
            Access::Half => *self.ram.get_mut(offset..)?.first_chunk_mut()? = (value as u16).to_le_bytes(),
            Access::Word => *self.ram.get_mut(offset..)?.first_chunk_mut()? = value.to_le_bytes(),
        }
        Some(())
    }

    /// A half-word of code.
    #[inline]
    pub fn fetch(&self, address: u32) -> Option<u16> {
        match Self::place(address)? {
            Place::Flash(offset) => load(&self.flash, offset, Access::Half).map(|half| half as u16),
            Place::Ram(offset) => {
                self.fetched.set(self.fetched.get() | 1 << (offset / 2048));
                load(&self.ram, offset, Access::Half).map(|half| half as u16)
            }
            Place::System(_) => None,
        }
    }

    /// Whether code was ever fetched from near this byte of RAM.
    pub fn holds_code(&self, offset: usize) -> bool {
        self.fetched.get() >> (offset / 2048) & 1 == 1
    }

    /// Factory words (RM0440 §48): the unique identifier, flash size and package; other words read as erased.
    pub fn system_word(&self, address: u32, option_register: u32) -> u32 {
        match address & !3 {
            0x1FFF_7590 => self.uid[0],
            0x1FFF_7594 => self.uid[1],
            0x1FFF_7598 => self.uid[2],
            0x1FFF_75E0 => 0xFFFF_0000 | (FLASH_SIZE as u32 / 1024),
            // LQFP64.
            0x1FFF_7500 => 0,
            OPTION_BASE => option_register,
            _ => 0xFFFF_FFFF,
        }
    }
}

/// Number of bytes that an access moves.
pub(crate) fn bytes(access: Access) -> usize {
    match access {
        Access::Byte => 1,
        Access::Half => 2,
        Access::Word => 4,
    }
}

/// The low `access` bits of a word that was shifted to the addressed byte.
pub(crate) fn narrow(word: u32, address: u32, access: Access) -> u32 {
    let shifted = word >> (8 * (address & 3));
    match access {
        Access::Byte => shifted & 0xFF,
        Access::Half => shifted & 0xFFFF,
        Access::Word => shifted,
    }
}

#[inline]
fn load(bytes: &[u8], offset: usize, access: Access) -> Option<u32> {
    Some(match access {
        Access::Byte => u32::from(*bytes.get(offset)?),
        Access::Half => u32::from(u16::from_le_bytes(*bytes.get(offset..)?.first_chunk()?)),
        Access::Word => u32::from_le_bytes(*bytes.get(offset..)?.first_chunk()?),
    })
}
