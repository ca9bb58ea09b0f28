//! The application of the board with a few instructions replaced: no build of its own for each way to fail.

use std::sync::OnceLock;

use vergence_image::layout::{FLASH_BASE, IMAGE, STACK};
use vergence_image::notes::{VersionNote, build_at, version_of};
use vergence_mcu::Firmware;

use super::build::build;

/// What becomes of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// As it is.
    Good,
    /// The first instruction jumps to itself.
    HangsAtStart,
    /// It starts, sets its own watchdog, and hangs in the first control tick.
    HangsWhenItRuns,
    /// `main` panics.
    PanicsAtStart,
    /// The stack is too small for `main`.
    StackTooSmall,
    /// The vector table holds no code's address but that of the entry, where there is no code either.
    BadVectors,
}

const START: u32 = FLASH_BASE + IMAGE.start;
/// B to itself.
const HANG: u16 = 0xE7FE;

/// The application, built once.
fn application() -> &'static Firmware {
    static READ: OnceLock<Firmware> = OnceLock::new();
    READ.get_or_init(|| {
        let elf = std::fs::read(build("vergence-nucleo-g474")).expect("cargo says where the ELF is");
        Firmware::from_elf(&elf).expect("the ELF is for this chip")
    })
}

/// The bytes for flash, of this version.
pub fn image(variant: Variant, version: [u8; 3]) -> Vec<u8> {
    let application = application();
    let mut image = application.flat(START);
    put_version(&mut image, version);
    let place = |symbol: &str| {
        let address = application.address_of(symbol).unwrap_or_else(|| panic!("no symbol {symbol}"));
        (address - START) as usize
    };
    match variant {
        Variant::Good => {}
        Variant::HangsAtStart => {
            let entry = u32::from_le_bytes(image[4..8].try_into().expect("four bytes")) & !1;
            put(&mut image, (entry - START) as usize, &[HANG]);
        }
        Variant::HangsWhenItRuns => put(&mut image, place("TIM7_DAC"), &[HANG]),
        Variant::PanicsAtStart => {
            let (main, panic) = (place("main"), place("core::panicking::panic"));
            // A message in RAM that nobody reads. MOVS R0, #0x20; LSLS R0, R0, #24; ADDS R0, #0xF0; B.W
            let [high, low] = branch(main + 6, panic);
            put(&mut image, main, &[0x2020, 0x0600, 0x30F0, high, low]);
        }
        Variant::StackTooSmall => image[..4].copy_from_slice(&(STACK.start + 2048).to_le_bytes()),
        Variant::BadVectors => {
            // Undefined instructions, and for addresses far from any memory.
            image[8..0x1D8].fill(0xDE);
            image[4..8].copy_from_slice(&(START + 0x101).to_le_bytes());
        }
    }
    image
}

fn put(image: &mut [u8], at: usize, code: &[u16]) {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    image[at..at + bytes.len()].copy_from_slice(&bytes);
}

/// Its version and a build of its own.
fn put_version(image: &mut [u8], version: [u8; 3]) {
    let note = size_of::<VersionNote>();
    let at = image.windows(note).position(|window| version_of(window) == Some([0, 1, 0]));
    // The version comes last but for a byte that fills up.
    let at = at.expect("the package's version") + note - 4;
    image[at..at + 3].copy_from_slice(&version);
    let build = build_at(image).expect("a build id");
    image[build..build + 3].copy_from_slice(&version);
}

/// B.W, encoding T4 (ARM DDI 0403E, A7.7.12).
fn branch(from: usize, to: usize) -> [u16; 2] {
    let offset = to as i32 - (from as i32 + 4);
    let bit = |number: u32| (offset >> number & 1) as u16;
    let sign = bit(24);
    let (j1, j2) = (1 ^ bit(23) ^ sign, 1 ^ bit(22) ^ sign);
    let high = 0xF000 | sign << 10 | (offset >> 12 & 0x3FF) as u16;
    [high, 0x9000 | j1 << 13 | j2 << 11 | (offset >> 1 & 0x7FF) as u16]
}
