//! `vergence soak --differential`: the native board and the firmware on the chip side by side.

use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::json;
use vergence_rig::rounded;
use vergence_soak::differential::{Delivered, Session, differential};

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Sessions, unless the command line names another number: each takes a second or two.
const SESSIONS: u64 = 100;

/// Plays `scenarios` sessions from the seed `first` on.
pub fn many(first: u64, scenarios: Option<u64>, boards: &Delivered, console: Console) -> Result<(), Failure> {
    let count = scenarios.unwrap_or(SESSIONS);
    let stopwatch = Stopwatch::start();
    let (progress, played) = (console.progress("comparing"), AtomicU64::new(0));
    let tally = differential(first, count, boards, || {
        let played = played.fetch_add(1, Ordering::Relaxed) + 1;
        progress.set_message(format!("{played} of {count} sessions"));
        progress.tick();
    })
    .map_err(|error| refused(&error))?;
    progress.finish_and_clear();
    let seconds = stopwatch.seconds();
    console.say(tally.table())?;
    console.say(format!(
        "{count} sessions on both boards, {} differ; {:.1} h of virtual time in {seconds:.1} s",
        tally.differences.len(),
        tally.virtual_seconds / 3600.0,
    ))?;
    let mut result = tally.json();
    result["seconds"] = rounded(seconds).into();
    console.result(&result)?;
    tally.accusation().map_or(Ok(()), |differences| Err(Failure::check(differences)))
}

/// Plays the session of one seed, and prints what happens in it.
pub fn replay(seed: u64, boards: &Delivered, console: Console) -> Result<(), Failure> {
    let verdict = Session::of(seed).on_both(boards).map_err(|error| refused(&error))?;
    console.say(verdict.journal.to_string().trim_end())?;
    let difference = verdict.difference.map(|difference| difference.to_string());
    console.result(&json!({ "seed": seed, "difference": difference }))?;
    match difference {
        None => Ok(()),
        Some(difference) => {
            Err(Failure::check(format!("the boards differ in the session of seed {seed}: {difference}")))
        }
    }
}

fn refused(error: &impl std::fmt::Display) -> Failure {
    Failure::check(format!("the controller refuses the simulated stages ({error})"))
}
