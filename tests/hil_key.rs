//! Boot loader and application on the simulated chip with a key of their own: what the development key signs is refused.
//! The built programs get another key in the place of the development key; with `VERGENCE_OWN_KEY` set, they are built
//! with that key instead, as docs/flashing.md says.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod elf_rig;

use elf_rig::{Conversation, DEVELOPMENT_SECRET, ElfBoard, Standing, build_trusting, programs, sealed_by};
use vergence_image::layout::{ACTIVE, FLASH_BASE, HARDWARE, IMAGE};
use vergence_image::{DEVELOPMENT_KEY, sha256};
use vergence_mcu::Firmware;
use vergence_protocol::management::{BootState, ImageHeader, Management, ManagementReport, Outcome, Signature};
use vergence_protocol::{Report, Request};

type Talk = Conversation<ElfBoard>;

/// RFC 8032, section 7.1, test 2.
const OWN_SECRET: [u8; 32] = [
    0x4c, 0xcd, 0x08, 0x9b, 0x28, 0xff, 0x96, 0xda, 0x9d, 0xb6, 0xc3, 0x46, 0xec, 0x11, 0x4e, 0x0f, 0x5b, 0x8a, 0x31,
    0x9f, 0x35, 0xab, 0xa6, 0x24, 0xda, 0x8c, 0xf6, 0xed, 0x4f, 0xb8, 0xa6, 0xfb,
];

fn own_key() -> [u8; 32] {
    salty::Keypair::from(&OWN_SECRET).public.to_bytes()
}

/// Application and boot loader that trust the own key, as they lie in flash.
fn own_programs() -> [Vec<u8>; 2] {
    let starts = [FLASH_BASE + IMAGE.start, FLASH_BASE];
    if std::env::var_os("VERGENCE_OWN_KEY").is_some() {
        let line = own_key().iter().fold("vergence-public-key ".to_owned(), |line, byte| format!("{line}{byte:02x}"));
        let built = ["vergence-nucleo-g474", "vergence-bootloader"].map(|package| {
            let elf = std::fs::read(build_trusting(package, &line)).expect("cargo says where the ELF is");
            Firmware::from_elf(&elf).expect("the ELF is for this chip")
        });
        return [0, 1].map(|index| built[index].flat(starts[index]));
    }
    let [application, boot_loader] = programs();
    [(application, starts[0]), (boot_loader, starts[1])].map(|(program, start)| with_own_key(program, start))
}

fn with_own_key(program: &Firmware, start: u32) -> Vec<u8> {
    let mut bytes = program.flat(start);
    let at = bytes.windows(32).position(|window| window == DEVELOPMENT_KEY).expect("the key lies in flash");
    bytes[at..at + 32].copy_from_slice(&own_key());
    assert!(!bytes.windows(32).any(|window| window == DEVELOPMENT_KEY), "once");
    bytes
}

/// A board with both programs, the application sealed by `secret`.
fn board(secret: &[u8; 32]) -> Talk {
    let [application, boot_loader] = own_programs();
    let mut talk = Talk::off(&Standing::default());
    let chip = talk.board.machine.chip_mut();
    let seal = sealed_by(secret, &application).to_bytes();
    assert!(chip.load_flash(0, &boot_loader) && chip.load_flash(IMAGE.start as usize, &application));
    assert!(chip.load_flash(ACTIVE.start as usize, &seal));
    talk.board.machine.power_on();
    talk.wait(600_000);
    talk
}

fn manage(talk: &mut Talk, request: Management) -> ManagementReport {
    talk.management.clear();
    talk.host.manage(request).expect("the line takes it");
    talk.wait_until("no answer", |talk| !talk.management.is_empty());
    talk.management.remove(0)
}

/// Sends an image of eight bytes, signed by `secret`; returns what the board makes of it.
fn flash(talk: &mut Talk, secret: &[u8; 32]) -> Outcome {
    let data = [7; 8];
    let header = ImageHeader { hardware: HARDWARE, version: [0, 1, 0], length: 8, build: 2, sha256: sha256(&data) };
    let signature = salty::Keypair::from(secret).sign(&header.signed_bytes()).to_bytes();
    let [r, s] = [0, 32].map(|at| signature[at..at + 32].try_into().expect("half of 64 bytes"));
    let chunk = Management::Chunk { offset: 0, data: data.iter().copied().collect() };
    let mut last = Outcome::Done;
    for request in [Management::Begin(header), chunk, Management::Commit(Signature { r, s })] {
        let ManagementReport::Progress { outcome, .. } = manage(talk, request) else { panic!("no progress") };
        last = outcome;
    }
    last
}

#[test]
fn an_application_signed_by_the_development_key_is_not_started() {
    let mut talk = board(&DEVELOPMENT_SECRET);
    let ManagementReport::Identity(identity) = manage(&mut talk, Management::Identify) else { panic!("no identity") };
    assert_eq!(identity.boot, BootState::Recovery);
    assert_eq!(flash(&mut talk, &DEVELOPMENT_SECRET), Outcome::WrongSignature);
    assert_eq!(flash(&mut talk, &OWN_SECRET), Outcome::Done);
}

#[test]
fn an_application_takes_and_names_its_own_key_and_no_other() {
    let mut talk = board(&OWN_SECRET);
    talk.connect();
    let Report::Key { key, .. } = talk.answer(Request::GetKey) else { panic!("no key") };
    assert_eq!(key, own_key());
    assert_eq!(flash(&mut talk, &DEVELOPMENT_SECRET), Outcome::WrongSignature);
    assert_eq!(flash(&mut talk, &OWN_SECRET), Outcome::Done);
}

#[test]
fn without_a_key_of_its_own_a_board_says_that_it_trusts_the_development_key() {
    let mut talk = Talk::open(&Standing::default());
    let Report::Key { key, .. } = talk.answer(Request::GetKey) else { panic!("no key") };
    assert_eq!(key, DEVELOPMENT_KEY);
}
