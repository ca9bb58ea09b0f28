//! The board's own programs, as cargo builds them.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]
#![allow(dead_code, reason = "each test file uses its own part")]

#[path = "../../../../tests/elf_rig/build.rs"]
mod build;

use std::sync::OnceLock;

use vergence_image::Seal;
use vergence_image::layout::{FLASH_BASE, IMAGE};
use vergence_mcu::Firmware;
use vergence_protocol::management::{ImageHeader, Signature};
use vergence_soak::ChipFlash;
use vergence_soak::differential::Delivered;
use vergence_soak::power_cuts::{SignedImage, twin};

/// RFC 8032, section 7.1, test 1: the key of development images.
const SECRET: [u8; 32] = [
    0x9d, 0x61, 0xb1, 0x9d, 0xef, 0xfd, 0x5a, 0x60, 0xba, 0x84, 0x4a, 0xf4, 0x92, 0xec, 0x2c, 0xc4, 0x44, 0x49, 0xc5,
    0x69, 0x7b, 0x32, 0x69, 0x19, 0x70, 0x3b, 0xac, 0x03, 0x1c, 0xae, 0x7f, 0x60,
];

fn seal(header: ImageHeader) -> Seal {
    let signature = salty::Keypair::from(&SECRET).sign(&header.signed_bytes()).to_bytes();
    let [r, s] = [0, 32].map(|at| signature[at..at + 32].try_into().expect("half of 64 bytes"));
    Seal { header, signature: Signature { r, s } }
}

/// The application and the boot loader.
fn built() -> [Firmware; 2] {
    ["vergence-nucleo-g474", "vergence-bootloader"].map(|package| {
        let bytes = std::fs::read(build::build(package)).expect("cargo says where the ELF is");
        Firmware::from_elf(&bytes).expect("the ELF is for this chip")
    })
}

/// Both boards with these programs.
pub fn delivered() -> &'static Delivered {
    static READ: OnceLock<Delivered> = OnceLock::new();
    READ.get_or_init(|| {
        let [application, boot_loader] = built();
        Delivered::new(&boot_loader, &application, seal).expect("they fit")
    })
}

/// The boot loader, and the application with its own bytes and with exchanged registers.
pub fn programs() -> (Firmware, [SignedImage; 2]) {
    let [application, boot_loader] = built();
    let [old, new] = [application.flat(FLASH_BASE + IMAGE.start), twin(&application)];
    let differing = old.chunks(2048).zip(new.chunks(2048)).filter(|(old, new)| old != new).count();
    let pages = old.len().div_ceil(2048);
    assert!(5 * differing >= 4 * pages, "{differing} of {pages} pages differ: a swap could mix up the others unseen");
    (boot_loader, [old, new].map(|bytes| SignedImage::new(bytes, [0, 1, 0], seal)))
}

/// The flash of a delivered board with these programs.
pub fn flash() -> &'static ChipFlash {
    static READ: OnceLock<ChipFlash> = OnceLock::new();
    READ.get_or_init(|| {
        let (boot_loader, [application, _]) = programs();
        ChipFlash::new(&boot_loader, &application).expect("they fit")
    })
}
