//! What a boot loader takes for an image, and what not.
#![allow(clippy::unwrap_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_image::layout::{ACTIVE, CAPACITY, HARDWARE, PAGE};
use vergence_image::{DEVELOPMENT_KEY, ImageFile, SEAL_LENGTH, Seal, SealError, sha256};
use vergence_protocol::management::{ImageHeader, Signature};

/// RFC 8032, section 7.1, test 1.
const SECRET: [u8; 32] = [
    0x9d, 0x61, 0xb1, 0x9d, 0xef, 0xfd, 0x5a, 0x60, 0xba, 0x84, 0x4a, 0xf4, 0x92, 0xec, 0x2c, 0xc4, 0x44, 0x49, 0xc5,
    0x69, 0x7b, 0x32, 0x69, 0x19, 0x70, 0x3b, 0xac, 0x03, 0x1c, 0xae, 0x7f, 0x60,
];

fn sign(header: ImageHeader) -> Seal {
    let signature = salty::Keypair::from(&SECRET).sign(&header.signed_bytes()).to_bytes();
    let (r, s) = (signature[..32].try_into().unwrap(), signature[32..].try_into().unwrap());
    Seal { header, signature: Signature { r, s } }
}

fn header(image: &[u8]) -> ImageHeader {
    let length = u32::try_from(image.len()).unwrap();
    ImageHeader { hardware: HARDWARE, version: [1, 2, 3], length, build: 0x0123_4567_89AB_CDEF, sha256: sha256(image) }
}

/// An image as it lies in flash, sealed with `seal`.
fn region(image: &[u8], seal: &Seal) -> Vec<u8> {
    let mut region = vec![0xFF; ACTIVE.length as usize];
    region[..SEAL_LENGTH].copy_from_slice(&seal.to_bytes());
    region[PAGE as usize..][..image.len()].copy_from_slice(image);
    region
}

#[test]
fn the_development_key_is_that_of_the_published_secret() {
    assert_eq!(salty::Keypair::from(&SECRET).public.to_bytes(), DEVELOPMENT_KEY);
}

/// FIPS 180-4, the example "abc".
#[test]
fn sha256_is_sha256() {
    assert_eq!(sha256(b"abc")[..8], [0xba, 0x78, 0x16, 0xbf, 0x8f, 0x01, 0xcf, 0xea]);
}

#[test]
fn a_sealed_image_is_sound() {
    let image = [0x5A; 1000];
    let seal = sign(header(&image));
    assert_eq!(Seal::check(&region(&image, &seal), &DEVELOPMENT_KEY), Ok(seal));
}

#[test]
fn each_fault_has_its_name() {
    let image = [0x5A; 1000];
    let judge = |header: ImageHeader| Seal::check(&region(&image, &sign(header)), &DEVELOPMENT_KEY);
    let good = header(&image);
    assert_eq!(judge(ImageHeader { hardware: HARDWARE + 1, ..good }), Err(SealError::WrongHardware));
    assert_eq!(judge(ImageHeader { length: 0, ..good }), Err(SealError::WrongLength));
    assert_eq!(judge(ImageHeader { length: CAPACITY + 1, ..good }), Err(SealError::WrongLength));
    assert_eq!(judge(ImageHeader { length: u32::MAX, ..good }), Err(SealError::WrongLength));
    assert_eq!(judge(ImageHeader { length: 999, ..good }), Err(SealError::WrongDigest));
    assert_eq!(Seal::check(&[0xFF; ACTIVE.length as usize], &DEVELOPMENT_KEY), Err(SealError::Missing));
    assert_eq!(Seal::check(&[], &DEVELOPMENT_KEY), Err(SealError::Missing));
    let stranger = salty::Keypair::from(&[7; 32]).public.to_bytes();
    assert_eq!(Seal::check(&region(&image, &sign(good)), &stranger), Err(SealError::WrongSignature));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_seal_survives_its_bytes(version: [u8; 3], build: u64, length: u32, sha256: [u8; 32], r: [u8; 32], s: [u8; 32]) {
        let seal = Seal {
            header: ImageHeader { hardware: HARDWARE, version, length, build, sha256 },
            signature: Signature { r, s },
        };
        prop_assert_eq!(Seal::from_bytes(&seal.to_bytes()), Ok(seal));
    }

    #[test]
    fn one_wrong_bit_anywhere_is_noticed(bit in 0..8_usize, at: prop::sample::Index) {
        let image = [0xC3; 256];
        let mut bytes = region(&image, &sign(header(&image)));
        // The image, the seal's fields and their check; what fills the rest up says nothing.
        let start = PAGE as usize;
        let judged: Vec<usize> = (0..SEAL_LENGTH - 5).chain(start..start + image.len()).collect();
        bytes[judged[at.index(judged.len())]] ^= 1 << bit;
        prop_assert!(Seal::check(&bytes, &DEVELOPMENT_KEY).is_err());
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..2 * SEAL_LENGTH)) {
        prop_assert_eq!(Seal::check(&bytes, &DEVELOPMENT_KEY).is_ok(), false);
    }
}

#[test]
fn a_file_is_the_seal_and_the_image() {
    let image = [0x5A; 1001];
    let seal = sign(ImageHeader { hardware: 7, ..header(&image) });
    let file = [&seal.to_bytes()[..], &image].concat();
    let read = ImageFile::read(&file).unwrap();
    assert_eq!((read.seal, read.image), (seal, &image[..]));
    assert!(read.is_signed_by(&DEVELOPMENT_KEY));
    assert!(!read.is_signed_by(&[7; 32]));

    assert_eq!(ImageFile::read(&image), Err(SealError::Missing));
    assert_eq!(ImageFile::read(&file[..100]), Err(SealError::Missing));
    assert_eq!(ImageFile::read(&file[..file.len() - 1]), Err(SealError::WrongLength));
    let empty = sign(ImageHeader { length: 0, ..header(&[]) });
    assert_eq!(ImageFile::read(&empty.to_bytes()), Err(SealError::WrongLength));
    let mut damaged = file;
    damaged[500] ^= 1;
    assert_eq!(ImageFile::read(&damaged), Err(SealError::WrongDigest));
}
