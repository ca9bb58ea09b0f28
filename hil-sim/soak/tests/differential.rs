//! Random sessions on the native board and on the firmware: both do the same.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod programs;

use std::sync::OnceLock;

use programs::programs;
use vergence_soak::ChipFlash;
use vergence_soak::differential::{Session, differential};

/// Sessions to play, unless `VERGENCE_DIFFERENTIAL` names another number.
const SESSIONS: u64 = 16;

fn flash() -> &'static ChipFlash {
    static READ: OnceLock<ChipFlash> = OnceLock::new();
    READ.get_or_init(|| {
        let (boot_loader, [application, _]) = programs();
        ChipFlash::new(&boot_loader, &application).expect("they fit")
    })
}

#[test]
fn both_boards_do_the_same_in_random_sessions() {
    if let Some(seed) = std::env::var("VERGENCE_SEED").ok().and_then(|seed| seed.parse().ok()) {
        let verdict = Session::of(seed).on_both(flash()).expect("the bench works");
        println!("{}\n{:?}", verdict.journal, verdict.figures);
    }
    let named = std::env::var("VERGENCE_DIFFERENTIAL").ok();
    let count = named.map_or(SESSIONS, |count| count.parse().expect("a number of sessions"));
    let tally = differential(std::env::var("START").map_or(1, |s| s.parse().unwrap()), count, flash(), || {}).expect("the bench works");
    println!("{}\n{:.0} s of virtual time", tally.table(), tally.virtual_seconds);
    assert!(tally.differences.is_empty(), "{}", tally.accusation().unwrap_or_default());
}
