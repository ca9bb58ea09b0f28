//! Power cuts in the middle of an update, with the firmware of the board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "../../../tests/elf_rig/build.rs"]
mod build;

use vergence_image::Seal;
use vergence_image::layout::{ACTIVE, FLASH_BASE};
use vergence_mcu::{Bench, BenchWiring, ChipConfig, Firmware, Halt, Machine, Picoseconds};
use vergence_plant::{Plant, bench_mechanics};
use vergence_protocol::management::{ImageHeader, Signature};
use vergence_soak::power_cuts::{Cut, CutTally, Journey, SignedImage, Sweep, twin};

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

/// The boot loader, and the application with its own bytes and with exchanged registers.
fn programs() -> (Firmware, [SignedImage; 2]) {
    let [application, boot_loader] = ["vergence-nucleo-g474", "vergence-bootloader"].map(|package| {
        let bytes = std::fs::read(build::build(package)).expect("cargo says where the ELF is");
        Firmware::from_elf(&bytes).expect("the ELF is for this chip")
    });
    let [old, new] = [application.flat(FLASH_BASE + ACTIVE.start), twin(&application)];
    let differing = old.chunks(2048).zip(new.chunks(2048)).filter(|(old, new)| old != new).count();
    let pages = old.len().div_ceil(2048);
    assert!(5 * differing >= 4 * pages, "{differing} of {pages} pages differ: a swap could mix up the others unseen");
    (boot_loader, [old, new].map(|bytes| SignedImage::new(bytes, [0, 1, 0], seal)))
}

fn sweep(journey: Journey) -> Sweep {
    let (boot_loader, images) = programs();
    Sweep::new(&boot_loader, images, journey).expect("it works without cuts")
}

/// All boards start one of the images.
fn assert_none_lost(tally: &CutTally) {
    println!("{tally:?}");
    let [_, _, recovery, bricked] = tally.endings();
    assert_eq!((recovery, bricked), (0, 0), "{:?}", tally.bricked);
}

#[test]
fn a_cut_at_every_erasure_every_state_word_and_a_part_of_the_rest_ends_in_an_intact_image() {
    let sweep = sweep(Journey::Update);
    let [_, critical] = sweep.critical();
    println!("{} operations", sweep.operations().len());
    let cuts = sweep.cut(0..critical + 400);
    let tally = sweep.tally(&cuts);
    assert_none_lost(&tally);
    assert!(tally.updated >= 5 && tally.endings()[0] > 0 && tally.endings()[1] > 0, "{tally:?}");

    // What is known from an equal start is true.
    let known: Vec<&Cut> = cuts.iter().filter(|cut| !cut.started).collect();
    for cut in known.iter().step_by(known.len() / 12 + 1) {
        let made = sweep.cut_one(cut.number, true);
        assert_eq!((&made.ending, made.updated), (&cut.ending, true), "{cut:?}");
    }
}

/// A start that finishes a swap: the same cycles, instructions, registers, memories, whether waiting is skipped or not.
#[test]
fn waiting_that_is_skipped_changes_nothing() {
    let sweep = sweep(Journey::Update);
    let [erasures, _] = sweep.critical();
    let cells = sweep.remains(erasures - 6);
    let [skipped, waited] = [true, false].map(|skips| {
        let plant = Plant::new(&bench_mechanics(), &[63_000.0, 40_000.0]);
        let mut machine = Machine::new(ChipConfig::default(), Bench::new(BenchWiring::nucleo_g474(), plant));
        machine.chip_mut().set_flash_cells(&cells);
        machine.power_on();
        machine.set_skips_waiting(skips);
        let halts = [5, 30, 100, 101, 500].map(|ms| {
            let halt = machine.run_until(Picoseconds::milliseconds(ms));
            assert_eq!(halt, Halt::Reached);
            (
                machine.cpu().now(),
                machine.cpu().instructions(),
                machine.cpu().state(),
                machine.chip().flash_operations(),
            )
        });
        println!("skips {skips}: {} operations", machine.chip().flash_operations());
        (halts, machine.chip().flash_cells(), machine.chip().ram().to_vec())
    });
    for (skipped, waited) in skipped.0.iter().zip(&waited.0) {
        assert_eq!(skipped, waited);
    }
    assert!(skipped.1 == waited.1 && skipped.2 == waited.2, "memories differ");
    assert!(skipped.0[4].3 > 500, "a page and more was copied");
}

/// embassy-boot 0.7 erases the state page while it still says "swap". After a cut there, the old state could persist
/// longer than the progress of the swap, which was then repeated over its own result.
#[test]
fn a_cut_in_the_erasure_that_ends_a_trial_spoils_no_image() {
    for journey in [Journey::Update, Journey::GoingBack] {
        let sweep = sweep(journey);
        let [erasures, _] = sweep.critical();
        // The last erasure, with so many kinds of damage.
        let cuts: Vec<Cut> =
            (0..24).map(|round| sweep.cut_one(erasures - 1 + round * sweep.operations().len(), round == 0)).collect();
        assert_none_lost(&sweep.tally(&cuts));
    }
}
