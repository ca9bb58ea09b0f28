//! The image in flash before an update, and the image that is sent.

use vergence_image::layout::{ACTIVE, FLASH_BASE, HARDWARE, IMAGE};
use vergence_image::notes::{build_at, build_of, version_of};
use vergence_image::{Seal, sha256};
use vergence_mcu::{Firmware, FlashCells};
use vergence_protocol::management::ImageHeader;

/// An application and its seal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignedImage {
    /// Header and signature.
    pub seal: Seal,
    /// The bytes for flash.
    pub bytes: Vec<u8>,
}

impl SignedImage {
    /// Seals the bytes of an application.
    #[must_use]
    pub fn new(bytes: Vec<u8>, version: [u8; 3], seal: impl Fn(ImageHeader) -> Seal) -> Self {
        let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        let build = build_of(&bytes).unwrap_or_default();
        let header = ImageHeader { hardware: HARDWARE, version, length, build, sha256: sha256(&bytes) };
        Self { seal: seal(header), bytes }
    }

    /// The image before an update of `application` and the one after it, which is its [`twin`].
    #[must_use]
    pub fn before_and_after(application: &Firmware, seal: impl Fn(ImageHeader) -> Seal) -> [Self; 2] {
        [application.flat(FLASH_BASE + IMAGE.start), twin(application)].map(|bytes| {
            let version = version_of(&bytes).unwrap_or_default();
            Self::new(bytes, version, &seal)
        })
    }

    /// Flash of a delivered board: the image, and the boot loader that starts it; `None` where they do not fit.
    #[must_use]
    pub fn delivered_with(&self, boot_loader: &Firmware) -> Option<FlashCells> {
        let mut cells = FlashCells::default();
        let mut fits = self.install(&mut cells);
        for (address, bytes) in boot_loader.segments() {
            fits &= cells.load(address.wrapping_sub(FLASH_BASE) as usize, bytes);
        }
        fits.then_some(cells)
    }

    /// Writes the image to where the boot loader starts it, as a debug probe would.
    pub fn install(&self, cells: &mut FlashCells) -> bool {
        cells.load(ACTIVE.start as usize, &self.seal.to_bytes()) && cells.load(IMAGE.start as usize, &self.bytes)
    }

    /// Whether the boot loader would start the image from these cells.
    #[must_use]
    pub fn is_installed(&self, cells: &FlashCells) -> bool {
        let [seal_at, start] = [ACTIVE, IMAGE].map(|region| region.start as usize);
        let holds = |at: usize, bytes: &[u8]| cells.bytes().get(at..at + bytes.len()) == Some(bytes);
        let torn = |word: &u32| (seal_at..start + self.bytes.len()).contains(&(*word as usize * 8));
        holds(start, &self.bytes) && holds(seal_at, &self.seal.to_bytes()) && !cells.torn().iter().any(torn)
    }
}

/// The same program with different bytes: instructions that add two registers have them exchanged, so that most pages
/// differ while the program does the same; and another build id. A swap that mixes up pages is thus noticed.
#[must_use]
pub fn twin(application: &Firmware) -> Vec<u8> {
    let start = FLASH_BASE + IMAGE.start;
    let mut flat = application.flat(start);
    for range in application.code() {
        let mut at = range.start.wrapping_sub(start) as usize;
        let end = range.end.wrapping_sub(start) as usize;
        while at + 2 <= end {
            let Some(half) = flat.get_mut(at..at + 2) else { break };
            let code = u16::from_le_bytes([half[0], half[1]]);
            half.copy_from_slice(&swapped(code).to_le_bytes());
            // Encodings of 32 bits begin so (ARM DDI 0403E, A5.1).
            at += if code >> 11 >= 0b11101 { 4 } else { 2 };
        }
    }
    if let Some(id) = build_at(&flat).and_then(|at| flat.get_mut(at..at + 8)) {
        id.iter_mut().for_each(|byte| *byte = !*byte);
    }
    flat
}

/// ADD (register) T1 and the loads and stores with a register offset T1 add Rn and Rm (A7.7.4, A7.7.45 and others).
const fn swapped(code: u16) -> u16 {
    let (m, n) = (code >> 6 & 7, code >> 3 & 7);
    if code & 0xFE00 == 0x1800 || code & 0xF000 == 0x5000 { code & 0xFE07 | n << 6 | m << 3 } else { code }
}
