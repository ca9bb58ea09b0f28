//! Flash memory in RAM that enforces the rules of real flash, and can lose power at a chosen operation.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_control::{Flash, FlashError, PAGE, UNIT};

/// State of a page or unit whose operation was interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Unchanged: the operation had not begun.
    Clean,
    /// Torn: the page or unit reads as garbage.
    Torn,
}

/// An area of flash.
#[derive(Clone, Debug)]
pub struct RamFlash {
    bytes: Vec<u8>,
    /// Units programmed since their page was erased.
    programmed: Vec<bool>,
    operations: usize,
    cut: Option<(usize, Cut)>,
    powered: bool,
    garbage: Pcg64Mcg,
}

impl RamFlash {
    /// Erased flash.
    #[must_use]
    pub fn new(pages: usize) -> Self {
        Self {
            bytes: vec![0xFF; pages * PAGE],
            programmed: vec![false; pages * PAGE / UNIT],
            operations: 0,
            cut: None,
            powered: true,
            garbage: Pcg64Mcg::seed_from_u64(0),
        }
    }

    /// Cuts the power in the erase or program operation after `operations` more of them. `seed` decides what is torn.
    pub fn cut_after(&mut self, operations: usize, how: Cut, seed: u64) {
        self.cut = Some((self.operations + operations, how));
        self.garbage = Pcg64Mcg::seed_from_u64(seed);
    }

    /// Restores the power.
    pub fn power_on(&mut self) {
        self.cut = None;
        self.powered = true;
    }

    /// Number of erase and program operations so far.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.operations
    }

    /// The contents.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Replaces the contents without operations.
    pub fn overwrite(&mut self, at: usize, bytes: &[u8]) {
        for (offset, &byte) in bytes.iter().enumerate() {
            if let Some(place) = self.bytes.get_mut(at + offset) {
                *place = byte;
                self.programmed[(at + offset) / UNIT] = true;
            }
        }
    }

    /// Returns whether the operation that begins now completes. A power cut may tear `from..to`.
    fn operate(&mut self, from: usize, to: usize) -> Result<(), FlashError> {
        if !self.powered || to > self.bytes.len() {
            return Err(FlashError);
        }
        if let Some((_, how)) = self.cut.filter(|(at, _)| *at <= self.operations) {
            self.powered = false;
            if how == Cut::Torn {
                self.tear(from, to);
            }
            return Err(FlashError);
        }
        self.operations += 1;
        Ok(())
    }

    /// Leaves each unit unchanged, erased or garbage.
    fn tear(&mut self, from: usize, to: usize) {
        for unit in (from..to).step_by(UNIT) {
            match self.garbage.random_range(0..3) {
                0 => {}
                1 => self.bytes[unit..unit + UNIT].fill(0xFF),
                _ => self.garbage.fill_bytes(&mut self.bytes[unit..unit + UNIT]),
            }
            self.programmed[unit / UNIT] = true;
        }
    }
}

impl Flash for RamFlash {
    fn pages(&self) -> usize {
        self.bytes.len() / PAGE
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        let (from, to) = (page * PAGE, (page + 1) * PAGE);
        self.operate(from, to)?;
        self.bytes[from..to].fill(0xFF);
        self.programmed[from / UNIT..to / UNIT].fill(false);
        Ok(())
    }

    fn program(&mut self, at: usize, unit: [u8; UNIT]) -> Result<(), FlashError> {
        self.operate(at, at + UNIT)?;
        let programmed = self.programmed.get_mut(at / UNIT).ok_or(FlashError)?;
        // A unit is written once: a second time makes the error correction bits beside it wrong.
        if !at.is_multiple_of(UNIT) || std::mem::replace(programmed, true) {
            return Err(FlashError);
        }
        self.bytes[at..at + UNIT].copy_from_slice(&unit);
        Ok(())
    }

    fn read(&mut self, at: usize, into: &mut [u8]) -> Result<(), FlashError> {
        into.copy_from_slice(self.bytes.get(at..at + into.len()).ok_or(FlashError)?);
        Ok(())
    }
}
