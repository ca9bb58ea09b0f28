//! The application sealed as the boot loader wants it.

use vergence_image::layout::{CAPACITY, FLASH_BASE, HARDWARE, IMAGE};
use vergence_image::{Seal, sha256};
use vergence_mcu::Firmware;
use vergence_protocol::management::{ImageHeader, Signature};

/// RFC 8032, section 7.1, test 1: the key of development images.
pub const DEVELOPMENT_SECRET: [u8; 32] = [
    0x9d, 0x61, 0xb1, 0x9d, 0xef, 0xfd, 0x5a, 0x60, 0xba, 0x84, 0x4a, 0xf4, 0x92, 0xec, 0x2c, 0xc4, 0x44, 0x49, 0xc5,
    0x69, 0x7b, 0x32, 0x69, 0x19, 0x70, 0x3b, 0xac, 0x03, 0x1c, 0xae, 0x7f, 0x60,
];

/// The application as it lies in flash, from [`IMAGE`] on, and its seal.
pub fn sealed(application: &Firmware) -> (Vec<u8>, Seal) {
    let image = application.flat(FLASH_BASE + IMAGE.start);
    let seal = sealed_by(&DEVELOPMENT_SECRET, &image);
    (image, seal)
}

/// The seal of an image, signed by `secret`.
pub fn sealed_by(secret: &[u8; 32], image: &[u8]) -> Seal {
    let length = u32::try_from(image.len()).expect("a flash is small");
    assert!(length <= CAPACITY);
    let header = ImageHeader { hardware: HARDWARE, version: [0, 1, 0], length, build: 1, sha256: sha256(image) };
    let signature = salty::Keypair::from(secret).sign(&header.signed_bytes()).to_bytes();
    let [r, s] = [0, 32].map(|at| signature[at..at + 32].try_into().expect("half of 64 bytes"));
    Seal { header, signature: Signature { r, s } }
}
