//! `vergence soak`: fault injection over the whole stack in virtual time.

mod power_cuts;

use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::{Map, Value, json};
use vergence_rig::rounded;
use vergence_soak::{Outcome, Scenario, Tally, native_board, run as play, soak};

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Most broken promises that are printed; more are only counted.
const MOST_TOLD: usize = 20;

/// Plays scenarios in which something goes wrong: bytes, frames, the line, the board, encoders, switches, motors, the
/// host's clock. A checker that knows the truth looks on: no stage passes a hard limit or moves without lease and arm, no
/// mode is reported that is not reached, the first fault is kept, and everything ends. Host session, protocol and
/// controller are the real ones; line and mechanics are simulated. Exit code 1 where a promise is broken.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many scenarios.
    #[arg(long, default_value_t = 10_000, value_name = "COUNT")]
    scenarios: u64,
    /// The seed of the first scenario; the next ones follow it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Plays the scenario of this seed alone, and prints what happens in it.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["scenarios", "seed"])]
    only: Option<u64>,
    #[command(flatten)]
    power: power_cuts::Options,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    if let Some(cuts) = args.power.cuts() {
        return power_cuts::run(&args.power, cuts, console);
    }
    match args.only {
        Some(seed) => replay(seed, console),
        None => many(args, console),
    }
}

fn many(args: &Args, console: Console) -> Result<(), Failure> {
    let stopwatch = Stopwatch::start();
    let progress = console.progress("soaking");
    let (played, every) = (AtomicU64::new(0), (args.scenarios / 200).max(1));
    let tally = soak(args.seed, args.scenarios, || {
        let played = played.fetch_add(1, Ordering::Relaxed) + 1;
        if played.is_multiple_of(every) {
            progress.set_message(format!("{played} of {} scenarios", args.scenarios));
            progress.tick();
        }
    })
    .map_err(|error| Failure::check(format!("the controller refuses the simulated stages ({error})")))?;
    progress.finish_and_clear();
    let seconds = stopwatch.seconds();
    console.say(table(&tally))?;
    console.say(format!(
        "{} scenarios, {} promises broken; {:.1} h of virtual time in {seconds:.1} s",
        args.scenarios,
        tally.violations.len(),
        tally.virtual_seconds / 3600.0,
    ))?;
    console.result(&in_json(args.scenarios, &tally, seconds))?;
    accuse(&tally)
}

fn table(tally: &Tally) -> String {
    let head = format!("{:<18}{:>10}{:>11}{:>11}{:>10}", "fault", "scenarios", "completed", "safe stops", "violated");
    let rows = tally.by_kind.iter().filter(|row| row.scenarios > 0).map(|row| {
        format!("{:<18}{:>10}{:>11}{:>11}{:>10}", row.kind, row.scenarios, row.completed, row.safe_stops, row.violated)
    });
    std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
}

fn in_json(scenarios: u64, tally: &Tally, seconds: f64) -> Value {
    let by_fault: Map<String, Value> = tally
        .by_kind
        .iter()
        .map(|row| {
            let counts =
                json!({ "scenarios": row.scenarios, "safe_stops": row.safe_stops, "completed": row.completed });
            (row.kind.name().to_owned(), counts)
        })
        .collect();
    json!({
        "scenarios": scenarios,
        "violations": tally.violations.len(),
        "by_fault": by_fault,
        "seconds": rounded(seconds),
    })
}

fn accuse(tally: &Tally) -> Result<(), Failure> {
    let Some((first, _)) = tally.violations.first() else { return Ok(()) };
    let lines: Vec<String> = tally
        .violations
        .iter()
        .take(MOST_TOLD)
        .map(|(seed, violation)| format!("  seed {seed}: {violation}"))
        .collect();
    Err(Failure::check(format!(
        "{} promises broken:\n{}\nreplay one: vergence soak --only {first}",
        tally.violations.len(),
        lines.join("\n")
    )))
}

fn replay(seed: u64, console: Console) -> Result<(), Failure> {
    let scenario = Scenario::of(seed);
    let mut board = native_board(&scenario)
        .map_err(|error| Failure::check(format!("the controller refuses the simulated stages ({error})")))?;
    let outcome = play(&scenario, &mut board);
    console.say(outcome.journal.to_string().trim_end())?;
    console.result(&replay_in_json(&scenario, &outcome))?;
    match outcome.violations.len() {
        0 => Ok(()),
        broken => Err(Failure::check(format!("{broken} promises broken in the scenario of seed {seed}"))),
    }
}

fn replay_in_json(scenario: &Scenario, outcome: &Outcome) -> Value {
    let events = outcome.journal.events().iter().map(|(at, what)| json!({ "us": at.0, "what": what }));
    let violations = outcome.violations.iter().map(|broken| json!({ "us": broken.at.0, "what": broken.to_string() }));
    json!({
        "seed": scenario.seed,
        "fault": scenario.kind.name(),
        "ending": format!("{:?}", outcome.ending),
        "violations": violations.collect::<Vec<_>>(),
        "log": events.collect::<Vec<_>>(),
    })
}
