//! Writes a firmware image to flash, page by page, in any number of attempts.
//!
//! Each unit is compared with the flash and programmed only if it differs. So an attempt that was interrupted continues at
//! the first page whose content differs, and a repeated chunk does nothing. A page that differs but was not erased in this
//! attempt is erased and written from its start: the board decides where to continue.

use sha2::{Digest, Sha256};
use vergence_protocol::management::{ImageHeader, Outcome, Signature};

use crate::services::{BoardServices, Flash, FlashError, PAGE, UNIT};

/// Number of bytes read at once to hash the image.
const BLOCK: usize = 256;

/// An update under way.
#[derive(Debug, Default)]
pub struct Updater {
    header: Option<ImageHeader>,
    /// Offset of the next byte wanted, a multiple of [`UNIT`].
    next: usize,
    /// The page that was erased last in this attempt and is being programmed.
    fresh: Option<usize>,
    /// Whether the boot loader was told to start the image.
    committed: bool,
}

impl Updater {
    /// Offset of the next byte of the image that the board wants.
    #[must_use]
    pub fn next(&self) -> u32 {
        let length = self.header.map_or(0, |header| header.length);
        u32::try_from(self.next).unwrap_or(u32::MAX).min(length)
    }

    /// Begins an image, or resumes the same one. The caller has checked version and hardware.
    pub fn begin(&mut self, header: &ImageHeader, services: &mut impl BoardServices) -> Outcome {
        if self.header == Some(*header) {
            return Outcome::Done;
        }
        if self.committed {
            return Outcome::Busy;
        }
        let capacity = services.image_flash().pages() * PAGE;
        if header.length == 0 || usize::try_from(header.length).is_ok_and(|length| length > capacity) {
            return Outcome::WrongLength;
        }
        *self = Self { header: Some(*header), ..Self::default() };
        Outcome::Done
    }

    /// Takes `data`, the bytes of the image at `offset`.
    pub fn chunk(&mut self, offset: u32, data: &[u8], services: &mut impl BoardServices) -> Outcome {
        let (Some(header), Ok(offset)) = (self.header, usize::try_from(offset)) else { return Outcome::NotBegun };
        let end = (header.length as usize).next_multiple_of(UNIT);
        let is_whole = offset.is_multiple_of(UNIT) && data.len().is_multiple_of(UNIT);
        if !is_whole || end.checked_sub(offset).is_none_or(|room| data.len() > room) {
            return Outcome::WrongLength;
        }
        if offset > self.next {
            return Outcome::Missing;
        }
        let known = (self.next - offset).min(data.len());
        let (units, _) = data[known..].as_chunks::<UNIT>();
        for unit in units {
            match self.store(*unit, services.image_flash()) {
                Ok(true) => {}
                Ok(false) => break,
                Err(FlashError) => {
                    self.restart_page();
                    return Outcome::FlashFailed;
                }
            }
        }
        Outcome::Done
    }

    /// Stores the next unit; returns false if its page must be written again from the start.
    fn store(&mut self, unit: [u8; UNIT], flash: &mut impl Flash) -> Result<bool, FlashError> {
        let mut stored = [0; UNIT];
        // A word that cannot be read, because a power cut tore it, must be written again.
        let holds = flash.read(self.next, &mut stored).is_ok() && stored == unit;
        if !holds {
            let page = self.next / PAGE;
            if self.fresh != Some(page) {
                flash.erase(page)?;
                self.fresh = Some(page);
                if !self.next.is_multiple_of(PAGE) {
                    self.next = page * PAGE;
                    return Ok(false);
                }
            }
            if unit != [0xFF; UNIT] {
                flash.program(self.next, unit)?;
            }
        }
        self.next += UNIT;
        Ok(true)
    }

    fn restart_page(&mut self) {
        self.next -= self.next % PAGE;
        self.fresh = None;
    }

    /// Checks digest and signature of the image and tells the boot loader to start it on trial.
    pub fn commit(&mut self, signature: &Signature, services: &mut impl BoardServices) -> Outcome {
        let Some(header) = self.header else { return Outcome::NotBegun };
        if self.next() < header.length {
            return Outcome::Missing;
        }
        match digest(header.length as usize, services.image_flash()) {
            Ok(digest) if digest == header.sha256 => {}
            Ok(_) => {
                *self = Self::default();
                return Outcome::WrongDigest;
            }
            Err(FlashError) => return Outcome::FlashFailed,
        }
        if !services.trusts(&header.signed_bytes(), signature) {
            return Outcome::WrongSignature;
        }
        if services.schedule_trial(&header, signature).is_err() {
            return Outcome::FlashFailed;
        }
        self.committed = true;
        Outcome::Done
    }
}

/// SHA-256 of the first `length` bytes of the flash.
fn digest(length: usize, flash: &mut impl Flash) -> Result<[u8; 32], FlashError> {
    let mut hash = Sha256::new();
    let mut block = [0; BLOCK];
    for at in (0..length).step_by(BLOCK) {
        let block = &mut block[..BLOCK.min(length - at)];
        flash.read(at, block)?;
        hash.update(&*block);
    }
    Ok(hash.finalize().into())
}
