//! `vergence soak`: fault injection over the whole stack in virtual time.

mod differential;
mod power_cuts;
mod programs;
mod robot;

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use vergence_rig::{Rig, rounded};
use vergence_sim::SimError;
use vergence_soak::robot::{RobotBoard, RobotScenario, native_robot};
use vergence_soak::{Board, Scenario, native_board, run as play, soak};

use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;
use crate::stopwatch::Stopwatch;

/// Scenarios, unless the command line names another number.
const SCENARIOS: u64 = 10_000;

/// Plays scenarios in which something goes wrong: bytes, frames, the line, the board, encoders, switches, motors, the
/// host's clock. A checker that knows the truth looks on: no stage passes a hard limit or moves without lease and arm, no
/// mode is reported that is not reached, the first fault is kept, and everything ends. Host session, protocol and
/// controller are the real ones; line and mechanics are simulated. The controller runs without a chip, or with --elf as the
/// board's own firmware on the simulated chip. Exit code 1 where a promise is broken.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many scenarios; 10 000 unless named, of --differential 100.
    #[arg(long, value_name = "COUNT")]
    scenarios: Option<u64>,
    /// The seed of the first scenario; the next ones follow it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Plays the scenario of this seed alone, and prints what happens in it.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["scenarios", "seed"])]
    only: Option<u64>,
    /// Plays random sessions on both boards instead: on the controller without a chip and, with the same bytes and the same
    /// mishaps at the same instants, on the board's own firmware. Every message, pose, step and place must agree, except for
    /// what hil-sim/FIDELITY.md lists. Exit code 1 where they differ.
    #[arg(long)]
    differential: bool,
    /// Plays scenarios of a robot instead, with the trunk of this rig file: its host goes through the modes by planned paths, while
    /// servos, their bus, the supply, the host or the board fail. The checker looks at the simulated trunk: links never touch,
    /// joints that are not concerned hold, positions are true, each harm is named, and the robot can be used again. 1 000 scenarios
    /// unless --scenarios names another number.
    #[arg(long, value_name = "RIG", conflicts_with = "differential")]
    robot: Option<PathBuf>,
    #[command(flatten)]
    programs: programs::Options,
    #[command(flatten)]
    power: power_cuts::Options,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    if let Some(file) = &args.robot {
        let rig = rig_file::load(Some(file))?;
        if args.programs.on_chip() {
            let flash = args.programs.flash()?;
            return on_robots(args, &rig, |scenario| flash.robot(&rig, scenario), console);
        }
        return on_robots(args, &rig, |scenario| native_robot(&rig, scenario), console);
    }
    if let Some(cuts) = args.power.cuts() {
        return power_cuts::run(&args.power, &args.programs, cuts, console);
    }
    if args.differential {
        let boards = args.programs.delivered()?;
        return match args.only {
            Some(seed) => differential::replay(seed, &boards, console),
            None => differential::many(args.seed, args.scenarios, &boards, console),
        };
    }
    if args.programs.on_chip() {
        let flash = args.programs.flash()?;
        return on_boards(args, |scenario| Ok(flash.board(scenario)), console);
    }
    let native = |scenario: &Scenario| {
        native_board(scenario)
            .map_err(|error| Failure::check(format!("the controller refuses the simulated stages ({error})")))
    };
    on_boards(args, native, console)
}

fn on_robots<B: RobotBoard>(
    args: &Args,
    rig: &Rig,
    board: impl Fn(&RobotScenario) -> Result<B, SimError> + Sync,
    console: Console,
) -> Result<(), Failure> {
    match args.only {
        Some(seed) => robot::replay(rig, seed, board, console),
        None => robot::many(rig, args.seed, args.scenarios, board, console),
    }
}

fn on_boards<B: Board>(
    args: &Args,
    board: impl Fn(&Scenario) -> Result<B, Failure> + Sync,
    console: Console,
) -> Result<(), Failure> {
    match args.only {
        Some(seed) => replay(seed, board, console),
        None => many(args, board, console),
    }
}

fn many<B: Board>(
    args: &Args,
    board: impl Fn(&Scenario) -> Result<B, Failure> + Sync,
    console: Console,
) -> Result<(), Failure> {
    let stopwatch = Stopwatch::start();
    let progress = console.progress("soaking");
    let scenarios = args.scenarios.unwrap_or(SCENARIOS);
    let (played, every) = (AtomicU64::new(0), (scenarios / 200).max(1));
    let tally = soak(args.seed, scenarios, board, || {
        let played = played.fetch_add(1, Ordering::Relaxed) + 1;
        if played.is_multiple_of(every) {
            progress.set_message(format!("{played} of {scenarios} scenarios"));
            progress.tick();
        }
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

fn replay<B: Board>(
    seed: u64,
    board: impl Fn(&Scenario) -> Result<B, Failure>,
    console: Console,
) -> Result<(), Failure> {
    let scenario = Scenario::of(seed);
    let outcome = play(&scenario, &mut board(&scenario)?);
    console.say(outcome.journal.to_string().trim_end())?;
    console.result(&outcome.json(&scenario))?;
    match outcome.violations.len() {
        0 => Ok(()),
        broken => Err(Failure::check(format!("{broken} promises broken in the scenario of seed {seed}"))),
    }
}
