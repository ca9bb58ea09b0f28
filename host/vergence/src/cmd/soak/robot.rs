//! `vergence soak --robot`: fault injection for a robot.

use std::sync::atomic::{AtomicU64, Ordering};

use serde_json::json;
use vergence_rig::{Rig, rounded};
use vergence_sim::SimError;
use vergence_soak::robot::{RobotBoard, RobotScenario, run_robot, soak_robot};

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Scenarios, unless the command line names another number.
const SCENARIOS: u64 = 1_000;

pub fn many<B: RobotBoard>(
    rig: &Rig,
    seed: u64,
    scenarios: Option<u64>,
    board: impl Fn(&RobotScenario) -> Result<B, SimError> + Sync,
    console: Console,
) -> Result<(), Failure> {
    let stopwatch = Stopwatch::start();
    let progress = console.progress("soaking the robot");
    let (scenarios, played) = (scenarios.unwrap_or(SCENARIOS), AtomicU64::new(0));
    let tally = soak_robot(rig, seed, scenarios, board, || {
        let played = played.fetch_add(1, Ordering::Relaxed) + 1;
        progress.set_message(format!("{played} of {scenarios} scenarios"));
        progress.tick();
    })?;
    progress.finish_and_clear();
    let seconds = stopwatch.seconds();
    console.say(tally.table())?;
    console.say(format!(
        "{scenarios} scenarios, {} promises broken; {:.1} h of virtual time in {seconds:.1} s",
        tally.violations.len(),
        tally.virtual_seconds / 3600.0,
    ))?;
    let mut result = tally.json();
    result["scenarios"] = scenarios.into();
    result["seconds"] = rounded(seconds).into();
    console.result(&result)?;
    tally.accusation().map_or(Ok(()), |broken| Err(Failure::check(broken)))
}

pub fn replay<B: RobotBoard>(
    rig: &Rig,
    seed: u64,
    board: impl Fn(&RobotScenario) -> Result<B, SimError>,
    console: Console,
) -> Result<(), Failure> {
    let scenario = RobotScenario::of(seed, rig.modes.len());
    let outcome = run_robot(rig, &scenario, &mut board(&scenario)?);
    console.say(outcome.journal.to_string().trim_end())?;
    let events = outcome.journal.events().iter().map(|(at, what)| json!({ "us": at.0, "what": what }));
    let violations = outcome.violations.iter().map(|broken| json!({ "us": broken.at.0, "what": broken.to_string() }));
    console.result(&json!({
        "seed": seed,
        "harm": scenario.kind.name(),
        "violations": violations.collect::<Vec<_>>(),
        "log": events.collect::<Vec<_>>(),
    }))?;
    match outcome.violations.len() {
        0 => Ok(()),
        broken => Err(Failure::check(format!("{broken} promises broken in the scenario of seed {seed}"))),
    }
}
