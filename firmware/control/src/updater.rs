//! Takes a firmware image into flash: page by page, in any number of attempts.
//!
//! Every unit is compared with what the flash holds and programmed only where it differs, so an attempt that was cut
//! goes on at the first page whose content differs, and a chunk that comes twice does nothing. A page that differs but
//! was not erased by this attempt is erased and taken again from its start: the board decides where to go on.

use sha2::{Digest, Sha256};
use vergence_protocol::management::{ImageHeader, Outcome, Signature};

use crate::flash::{Flash, FlashError, PAGE, UNIT};
use crate::services::BoardServices;

/// How much of the image is read at once to hash it.
const BLOCK: usize = 256;

/// An image on its way into flash.
#[derive(Debug, Default)]
pub struct Updater {
    header: Option<ImageHeader>,
    /// The next byte wanted, a multiple of the unit.
    next: usize,
    /// The page that was erased in this attempt and is being programmed.
    fresh: Option<usize>,
    /// The boot loader was told to start it.
    committed: bool,
}

impl Updater {
    /// The next byte of the image that is wanted.
    #[must_use]
    pub fn next(&self) -> u32 {
        let length = self.header.map_or(0, |header| header.length);
        u32::try_from(self.next).unwrap_or(u32::MAX).min(length)
    }

    /// Takes an image, or goes on with the same one. Version and hardware are checked before.
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

    /// Takes bytes of the image.
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

    /// Stores the next unit; false where its page must be taken again from the start.
    fn store(&mut self, unit: [u8; UNIT], flash: &mut impl Flash) -> Result<bool, FlashError> {
        let mut stored = [0; UNIT];
        // What cannot be read, as a word torn when power went, must be written anew.
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

    /// Checks the whole image and tells the boot loader to start it.
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

/// SHA-256 of what the flash holds.
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
