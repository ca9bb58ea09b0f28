//! Power cuts in the middle of an update, with the firmware of the board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod programs;

use programs::programs;
use vergence_mcu::{Bench, BenchWiring, ChipConfig, Halt, Machine, Picoseconds};
use vergence_plant::{Plant, bench_mechanics};
use vergence_soak::power_cuts::{Cut, CutTally, Journey, Sweep};

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

/// Cuts in other journeys than an update: all that `VERGENCE_POWER_CUTS` asks for, else a share of those at erasures and
/// words of the swap's state.
fn cuts_of(sweep: &Sweep, share: usize) -> Vec<Cut> {
    if let Ok(count) = std::env::var("VERGENCE_POWER_CUTS") {
        let operations = sweep.operations().len();
        return sweep.cut(0..count.parse::<usize>().expect("a number of cuts").min(operations));
    }
    let [_, critical] = sweep.critical();
    (0..share).map(|part| sweep.cut_one(part * critical / share, part == 0)).collect()
}

#[test]
fn going_back_and_rolling_back_end_in_an_intact_image() {
    for journey in [Journey::GoingBack, Journey::Rollback] {
        let sweep = sweep(journey);
        println!("{journey:?}: {} operations", sweep.operations().len());
        let tally = sweep.tally(&cuts_of(&sweep, 6));
        assert_none_lost(&tally);
        assert!(tally.updated > 0 && tally.endings()[1] > 0, "{tally:?}");
    }
}

/// There is no sound image before: a board either has the new one, or still waits for it.
#[test]
fn an_update_through_the_recovery_ends_in_the_new_image_or_in_the_recovery() {
    let sweep = sweep(Journey::Recovery);
    println!("{} operations", sweep.operations().len());
    let tally = sweep.tally(&cuts_of(&sweep, 6));
    println!("{tally:?}");
    let [old, new, recovery, bricked] = tally.endings();
    assert_eq!((old, bricked), (0, 0), "{:?}", tally.bricked);
    assert!(tally.updated > 0 && new + recovery > 0, "{tally:?}");
}

/// Every setting is that of the last saving or that of the one before, all of the same one, and saving works again.
#[test]
fn settings_that_are_being_saved_are_the_old_or_the_new_ones() {
    let sweep = sweep(Journey::Settings);
    let all = sweep.operations().len();
    println!("{all} operations");
    let parts = if std::env::var_os("VERGENCE_POWER_CUTS").is_some() { all } else { all.min(24) };
    let cuts: Vec<Cut> = (0..parts).map(|part| sweep.cut_one(part * all / parts, part.is_multiple_of(4))).collect();
    let tally = sweep.tally(&cuts);
    assert_none_lost(&tally);
    assert!(tally.updated > 4 && tally.endings()[0] > 4, "{tally:?}");
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
