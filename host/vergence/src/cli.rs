//! The command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::cmd;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::slots;

/// Moves a stereo rig of two fisheye cameras between its vision modes, and measures what it sees.
#[derive(Debug, Parser)]
#[command(
    name = "vergence",
    version,
    after_help = "Exit codes: 0 ok, 1 check failed, 2 usage or bad input, 3 device, 4 protocol mismatch."
)]
struct Cli {
    #[command(flatten)]
    globals: Globals,
    #[command(subcommand)]
    verb: Verb,
}

/// Options of every verb.
#[derive(Clone, Debug, clap::Args)]
pub struct Globals {
    /// The board: a serial device, tcp:HOST:PORT, or sim for a simulated one in this process. Without it, the only
    /// serial device there is.
    #[arg(long, global = true, env = "VERGENCE_PORT", value_name = "PORT")]
    pub port: Option<String>,
    /// Speed of a serial port.
    #[arg(long, global = true, default_value_t = 921_600)]
    pub baud: u32,
    /// The rig file. Without it, the active calibration (see `calibrate use`), or else the built-in bench; for demo always
    /// the bench. Reproduce and soak have rigs of their own.
    #[arg(long, global = true, env = "VERGENCE_RIG", value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// How long the board may go without hearing from this program before it brakes, 20ms to 1s.
    #[arg(long, global = true, default_value = "100ms", value_parser = parse_lease, value_name = "TIME")]
    pub lease: u16,
    /// Results as JSON.
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// List the serial ports.
    Devices(cmd::devices::Args),
    /// Tell what the board is doing, and why it stopped.
    Status(cmd::status::Args),
    /// Check ports, permissions, link, clock and board, and say what to do.
    Doctor(cmd::doctor::Args),
    /// Arm the board and keep it armed until Ctrl-C.
    Arm(cmd::arm::Args),
    /// Disarm the board; in motion it brakes first.
    Disarm(cmd::disarm::Args),
    /// Clear a latched fault or lost link.
    Clear(cmd::clear::Args),
    /// Find the reference of all axes.
    Home(cmd::home::Args),
    /// Go to a vision mode of the rig.
    Mode(cmd::mode::Args),
    /// Go to any pose.
    Move(cmd::move_to::Args),
    /// Show a move before it is made, or find the pose that measures as asked.
    Plan(cmd::plan::Args),
    /// Brake now, even while another vergence holds the port.
    Stop(cmd::stop::Args),
    /// Show poses as they come.
    Monitor(cmd::monitor::Args),
    /// Fire the cameras, and show where the axes were.
    Trigger(cmd::trigger::Args),
    /// Measure the link: round trips, losses, repeats.
    LinkTest(cmd::link_test::Args),
    /// Print the firmware's log.
    Log(cmd::log::Args),
    /// Show and change the board's settings.
    Config(cmd::config::Args),
    /// Run a simulated board that other programs can talk to.
    Sim(cmd::sim::Args),
    /// Update the board's firmware, over the link or a debug probe, or go back.
    Flash(cmd::flash::Args),
    /// Make keys, sign firmware images, show what they are.
    Image(cmd::image::Args),
    /// Measure how fast this program is, beside others on the same work.
    Bench(cmd::bench::Args),
    /// Let everything go wrong, ten thousand times, and check that the rig stays safe.
    Soak(cmd::soak::Args),
    /// Run the whole rig in simulation: home, herbivore, human, look, measure.
    Demo(cmd::demo::Args),
    /// Repeat the paper's experiments on the simulated rig.
    Reproduce(cmd::reproduce::Args),
    /// Turn a pair of photographs into a cloud of points.
    Depth(cmd::depth::Args),
    /// Measure live: a cloud of the newest pair, again and again, while the stages stand or move.
    Run(cmd::run::Args),
    /// Keep pre-trained networks for matching.
    Models(cmd::models::Args),
    /// Tell how much of the surroundings both cameras, one, or none see.
    Zones(cmd::zones::Args),
    /// Take a set of board views for calibration, with advice on what to show.
    Capture(cmd::capture::Args),
    /// Calibrate cameras, pairs and moving stages from boards; compare and keep calibrations.
    Calibrate(cmd::calibrate::Args),
    /// Show and convert camera files, and use them for single points.
    Camera(cmd::camera::Args),
    /// Draw a chessboard to print.
    Target(cmd::target::Args),
    /// Print a script that lets a shell complete this command.
    Completions(cmd::completions::Args),
}

/// The whole command line, for what describes it.
pub fn command() -> clap::Command {
    Cli::command()
}

/// Runs the command line and returns the exit code.
#[must_use]
pub fn run() -> ExitCode {
    // Usage errors leave with code 2 and help with 0, by clap itself.
    let cli = Cli::parse();
    match execute(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            tell(&failure);
            ExitCode::from(failure.kind().exit_code())
        }
    }
}

#[allow(clippy::print_stderr, reason = "the one place where failures are told")]
fn tell(failure: &Failure) {
    if failure.kind() != FailureKind::OutputClosed {
        eprintln!("vergence: {failure}");
    }
}

fn execute(cli: Cli) -> Result<(), Failure> {
    let Cli { mut globals, verb } = cli;
    // A stop must not fail, nor the doctor end, because a calibration cannot be read: they look for themselves.
    let without_rig = matches!(verb, Verb::Demo(_) | Verb::Soak(_) | Verb::Stop(_) | Verb::Doctor(_))
        || matches!(verb, Verb::Flash(_) | Verb::Image(_) | Verb::Reproduce(_));
    if globals.rig.is_none() && !without_rig {
        globals.rig = slots::active_rig()?;
    }
    let console = Console::new(globals.json);
    // With the board in this process nothing outside sets the pace: time can be virtual, and motion costs none.
    let virtual_time = matches!(verb, Verb::Demo(_) | Verb::Reproduce(_)) || globals.port.as_deref() == Some("sim");
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .start_paused(virtual_time)
        .build()
        .map_err(|error| Failure::device(format!("the asynchronous runtime does not start: {error}")))?;
    runtime.block_on(async {
        match verb {
            Verb::Devices(args) => cmd::devices::run(&args, console),
            Verb::Status(args) => cmd::status::run(&args, &globals, console).await,
            Verb::Doctor(args) => cmd::doctor::run(&args, &globals, console).await,
            Verb::Arm(args) => cmd::arm::run(&args, &globals, console).await,
            Verb::Disarm(args) => cmd::disarm::run(&args, &globals, console).await,
            Verb::Clear(args) => cmd::clear::run(&args, &globals, console).await,
            Verb::Home(args) => cmd::home::run(&args, &globals, console).await,
            Verb::Mode(args) => cmd::mode::run(&args, &globals, console).await,
            Verb::Move(args) => cmd::move_to::run(&args, &globals, console).await,
            Verb::Plan(args) => cmd::plan::run(&args, &globals, console).await,
            Verb::Stop(args) => cmd::stop::run(&args, &globals, console).await,
            Verb::Monitor(args) => cmd::monitor::run(&args, &globals, console).await,
            Verb::Trigger(args) => cmd::trigger::run(&args, &globals, console).await,
            Verb::LinkTest(args) => cmd::link_test::run(&args, &globals, console).await,
            Verb::Log(args) => cmd::log::run(&args, &globals, console).await,
            Verb::Config(args) => cmd::config::run(&args, &globals, console).await,
            Verb::Sim(args) => cmd::sim::run(&args, &globals, console).await,
            Verb::Flash(args) => cmd::flash::run(&args, &globals, console).await,
            Verb::Image(args) => cmd::image::run(&args, console),
            Verb::Bench(args) => cmd::bench::run(&args, console),
            Verb::Soak(args) => cmd::soak::run(&args, console),
            Verb::Demo(args) => cmd::demo::run(&args, &globals, console).await,
            Verb::Run(args) => cmd::run::run(&args, &globals, console).await,
            Verb::Reproduce(args) => cmd::reproduce::run(&args, &globals, console).await,
            Verb::Depth(args) => cmd::depth::run(&args, &globals, console),
            Verb::Models(args) => cmd::models::run(&args, console),
            Verb::Zones(args) => cmd::zones::run(&args, &globals, console),
            Verb::Capture(args) => cmd::capture::run(&args, &globals, console),
            Verb::Calibrate(args) => cmd::calibrate::run(&args, &globals, console).await,
            Verb::Camera(args) => cmd::camera::run(&args, console),
            Verb::Target(args) => cmd::target::run(&args, console),
            Verb::Completions(args) => cmd::completions::run(&args, console),
        }
    })
}

/// A duration that the board accepts as a lease, in milliseconds.
fn parse_lease(text: &str) -> Result<u16, String> {
    let duration: std::time::Duration = humantime::parse_duration(text).map_err(|error| error.to_string())?;
    match u16::try_from(duration.as_millis()) {
        Ok(ms @ 20..=1000) => Ok(ms),
        _ => Err("a lease is 20ms to 1s".into()),
    }
}
