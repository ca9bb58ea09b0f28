//! The command line: its verbs, its help by task, and how a failure ends it.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use serde_json::json;

use crate::cmd;
pub use crate::cmd::options::CommonOptions;
use crate::cmd::options::{BoardOptions, Choice, PortOptions, RigFileOptions, With};
use crate::console::Console;
use crate::failure::{Failure, FailureKind};

/// Moves a stereo rig of two fisheye cameras between its vision modes, and measures what it sees.
#[derive(Debug, Parser)]
#[command(
    name = "vergence",
    version,
    disable_help_subcommand = true,
    after_help = "Exit codes: 0 ok, 1 check failed, 2 usage or bad input, 3 device, 4 protocol mismatch."
)]
struct Cli {
    /// Prints results as JSON, and a failure as a JSON object on standard error.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Lists the boards and the cameras of this computer.
    Devices(With<PortOptions, cmd::devices::Args>),
    /// Prints what the board is doing, and why it stopped.
    Status(With<BoardOptions, cmd::status::Args>),
    /// Checks ports, permissions, link, clock and board, and says what to do.
    Doctor(With<BoardOptions, cmd::doctor::Args>),
    /// Arms the board and keeps it armed until Ctrl-C.
    Arm(With<BoardOptions, cmd::orders::Arm>),
    /// Disarms the board; a moving board brakes first.
    Disarm(With<BoardOptions, cmd::orders::Disarm>),
    /// Clears a latched fault or lost link.
    Clear(With<BoardOptions, cmd::orders::Clear>),
    /// Finds the reference of all axes.
    Home(With<BoardOptions, cmd::orders::Home>),
    /// Moves to a vision mode of the rig.
    Mode(With<BoardOptions, cmd::orders::Mode>),
    /// Moves to any pose.
    Move(With<BoardOptions, cmd::move_to::Args>),
    /// Shows a move before it is made, or finds the pose for a goal.
    Plan(With<BoardOptions, cmd::plan::Args>),
    /// Brakes now, even while another vergence holds the port.
    Stop(With<BoardOptions, cmd::stop::Args>),
    /// Prints poses as they come.
    Monitor(With<BoardOptions, cmd::monitor::Args>),
    /// Triggers the cameras, and prints where the axes were.
    Trigger(With<BoardOptions, cmd::trigger::Args>),
    /// Measures the link: round trips, losses, repeats.
    LinkTest(With<BoardOptions, cmd::link_test::Args>),
    /// Prints the firmware's log.
    Log(With<BoardOptions, cmd::log::Args>),
    /// Prints and changes the board's settings.
    Config(With<BoardOptions, cmd::config::Args>),
    /// Runs a simulated board that other programs can talk to.
    Sim(With<RigFileOptions, cmd::sim::Args>),
    /// Updates the board's firmware over the link or a debug probe, or goes back.
    Flash(With<PortOptions, cmd::flash::Args>),
    /// Makes the servos of a robot ready: finds, numbers and tests them over a USB adapter.
    Servo(cmd::servo::Args),
    /// Makes keys, signs firmware images, prints what an image holds.
    Image(cmd::image::Args),
    /// Measures the speed of this program beside others on the same work.
    Bench(cmd::bench::Args),
    /// Injects ten thousand faults in simulation, and checks that the rig stays safe.
    Soak(cmd::soak::Args),
    /// Runs the whole rig in simulation: homes, moves, takes images, measures.
    Demo(With<RigFileOptions, cmd::demo::Args>),
    /// Repeats the paper's experiments on the simulated rig.
    Reproduce(cmd::reproduce::Args),
    /// Turns a pair of photographs into a cloud of points.
    Depth(With<RigFileOptions, cmd::depth::Args>),
    /// Measures live: a cloud of the newest pair, again and again, at rest or in motion.
    Run(With<BoardOptions, cmd::run::Args>),
    /// Records images, encoders and events without measuring.
    Record(With<BoardOptions, cmd::run::record::Args>),
    /// Measures a recording as `run` measured while it recorded.
    Replay(cmd::replay::Args),
    /// Writes a recording, or images, for other programs.
    Export(cmd::export::Args),
    /// Serves a page on which people see and drive the rig.
    Panel(With<BoardOptions, cmd::panel::Args>),
    /// Watches rigs that other machines publish, and sends them to modes.
    Peers(cmd::peers::Args),
    /// Keeps pre-trained networks for matching.
    Models(cmd::models::Args),
    /// Computes how much of the surroundings both cameras, one, or none see.
    Zones(With<RigFileOptions, cmd::zones::Args>),
    /// Takes a set of views of a target for calibration, with advice on what to show.
    Capture(With<RigFileOptions, cmd::capture::Args>),
    /// Calibrates cameras, pairs and moving stages from views of a target; compares and keeps calibrations.
    Calibrate(cmd::calibrate::Args),
    /// Tests attached cameras; prints and converts camera files, and uses them for single points.
    #[command(alias = "cameras")]
    Camera(cmd::camera::Args),
    /// Makes rig files of other programs' cameras, and other programs' files of rigs.
    Rig(cmd::rig::Args),
    /// Draws a calibration target to print.
    Target(cmd::target::Args),
    /// Prints a script that lets a shell complete this command.
    Completions(cmd::completions::Args),
}

/// The verbs by task, in the order of the help.
pub const TASKS: &[(&str, &[&str])] = &[
    ("Try without hardware", &["demo", "sim", "reproduce"]),
    ("Set up a board", &["devices", "doctor", "config", "flash", "image", "servo"]),
    ("Calibrate", &["target", "capture", "calibrate", "camera", "rig"]),
    ("Move", &["home", "mode", "move", "plan", "stop", "arm", "disarm", "clear"]),
    ("Measure", &["run", "record", "replay", "export", "panel", "peers", "depth", "zones", "models"]),
    ("Watch a board", &["status", "monitor", "trigger", "log", "link-test"]),
    ("Check this program", &["bench", "soak"]),
    ("Shell", &["completions", "help"]),
];

/// The whole command line, with its verbs grouped by task in the help.
pub fn command() -> clap::Command {
    let command = Cli::command().subcommand(
        clap::Command::new("help")
            .about("Prints this help, or the help of a verb")
            .arg(clap::Arg::new("verb").num_args(0..).value_name("VERB").help("The verb")),
    );
    let mut tasks = String::new();
    for (task, verbs) in TASKS {
        tasks += &format!("{task}:\n");
        for verb in *verbs {
            let about = command.find_subcommand(verb).and_then(clap::Command::get_about);
            tasks += &format!("  {verb:<12} {}\n", about.map(ToString::to_string).unwrap_or_default());
        }
        tasks += "\n";
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{tasks}Options:\n{{options}}{{after-help}}"
    ))
}

/// Runs the command line and returns the exit code.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = after_verb(std::env::args_os().collect());
    let json = arguments.iter().any(|argument| argument == "--json");
    let matches = match command().try_get_matches_from(arguments) {
        Ok(matches) => matches,
        Err(error) if json && error.use_stderr() => {
            // Without the lines on usage, which are for people.
            let message = error.to_string();
            let message = message.split("\n\nUsage:").next().unwrap_or_default().trim_start_matches("error: ");
            return fail(&Failure::usage(message.trim_end()), true);
        }
        // Usage errors leave with code 2 and help with 0, by clap itself.
        Err(error) => error.exit(),
    };
    if let Some(("help", help)) = matches.subcommand() {
        return print_help(help);
    }
    let virtual_time = has_virtual_time(&matches);
    let result = Cli::from_arg_matches(&matches)
        .map_err(|error| Failure::usage(error.to_string()))
        .and_then(|cli| execute(cli, virtual_time));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => fail(&failure, json),
    }
}

/// Options that may also stand before the verb, and that take a value.
const BEFORE_VERB: [&str; 4] = ["--port", "--baud", "--rig", "--lease"];

/// Moves options that stand before the verb behind everything else: `--port sim home` reads as `home --port sim`.
fn after_verb(arguments: Vec<OsString>) -> Vec<OsString> {
    let mut rest = arguments.into_iter().peekable();
    let mut front: Vec<OsString> = rest.next().into_iter().collect();
    let mut moved = Vec::new();
    while let Some(argument) = rest.next_if(|argument| argument.to_string_lossy().starts_with("--")) {
        let text = argument.to_string_lossy().into_owned();
        let name = text.split('=').next().unwrap_or_default();
        if !BEFORE_VERB.contains(&name) {
            front.push(argument);
            continue;
        }
        moved.push(argument);
        if name == text {
            moved.extend(rest.next());
        }
    }
    let mut back: Vec<OsString> = rest.collect();
    if back.is_empty() {
        // No verb follows: clap says so.
        return [front, moved].concat();
    }
    let end = back.iter().position(|argument| argument == "--").unwrap_or(back.len());
    back.splice(end..end, moved);
    [front, back].concat()
}

/// `vergence help`, and `vergence help VERB...`.
fn print_help(help: &ArgMatches) -> ExitCode {
    let verbs = help.get_many::<String>("verb").into_iter().flatten();
    let arguments = std::iter::once("vergence".to_owned()).chain(verbs.cloned()).chain(["--help".to_owned()]);
    match command().try_get_matches_from(arguments) {
        Err(error) => error.exit(),
        Ok(_) => ExitCode::SUCCESS,
    }
}

/// With the board in this process nothing outside sets the pace: time can be virtual, and motion costs none.
fn has_virtual_time(matches: &ArgMatches) -> bool {
    let Some((verb, mut inner)) = matches.subcommand() else { return false };
    while let Some((_, deeper)) = inner.subcommand() {
        inner = deeper;
    }
    // People look at a panel, and the clock of people runs; ports, files and attached cameras keep real time too.
    let mut cameras = inner.try_get_many::<String>("cameras").ok().flatten().into_iter().flatten();
    let on_a_page = inner.try_contains_id("panel").is_ok_and(|given| given);
    if on_a_page || matches!(verb, "panel" | "devices") || cameras.any(|name| name != "sim") {
        return false;
    }
    let port = inner.try_get_one::<String>("port").ok().flatten();
    matches!(verb, "demo" | "reproduce") || port.is_some_and(|port| port == "sim" || port.starts_with("sim:"))
}

/// Prints why the command failed on standard error, and returns the exit code.
#[allow(clippy::print_stderr, reason = "the one place where failures are printed")]
fn fail(failure: &Failure, json: bool) -> ExitCode {
    let (kind, code) = (failure.kind(), failure.kind().exit_code());
    match kind {
        FailureKind::OutputClosed => {}
        _ if json => eprintln!(
            "{}",
            json!({ "error": { "kind": kind.name(), "exit_code": code, "message": failure.to_string() } })
        ),
        _ => eprintln!("vergence: {failure}"),
    }
    ExitCode::from(code)
}

fn execute(cli: Cli, virtual_time: bool) -> Result<(), Failure> {
    let Cli { json, verb } = cli;
    let console = Console::new(json);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .start_paused(virtual_time)
        .build()
        .map_err(|error| Failure::device(format!("the asynchronous runtime does not start: {error}")))?;
    let result = runtime.block_on(async {
        match verb {
            Verb::Devices(verb) => cmd::devices::run(&verb.args, &verb.options.given(), console).await,
            Verb::Status(verb) => cmd::status::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Doctor(verb) => cmd::doctor::run(&verb.args, &verb.options.given(), console).await,
            Verb::Arm(verb) => cmd::orders::arm(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Disarm(verb) => cmd::orders::disarm(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Clear(verb) => cmd::orders::clear(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Home(verb) => cmd::orders::home(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Mode(verb) => cmd::orders::mode(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Move(verb) => cmd::move_to::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Plan(verb) => cmd::plan::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Stop(verb) => cmd::stop::run(&verb.args, &verb.options.given(), console).await,
            Verb::Monitor(verb) => cmd::monitor::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Trigger(verb) => cmd::trigger::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::LinkTest(verb) => cmd::link_test::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Log(verb) => cmd::log::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Config(verb) => cmd::config::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Sim(verb) => cmd::sim::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Flash(verb) => cmd::flash::run(&verb.args, &verb.options.given(), console).await,
            Verb::Servo(args) => cmd::servo::run(args, console).await,
            Verb::Image(args) => cmd::image::run(&args, console),
            Verb::Bench(args) => cmd::bench::run(&args, console),
            Verb::Soak(args) => cmd::soak::run(&args, console),
            Verb::Demo(verb) => match verb.args.on_a_page() {
                Some(shown) => cmd::panel::demonstrate(shown, &verb.options.given(), console).await,
                None => cmd::demo::run(&verb.args, &verb.options.given(), console).await,
            },
            Verb::Run(verb) => cmd::run::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Record(verb) => cmd::run::record::record(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Replay(args) => cmd::replay::run(&args, console).await,
            Verb::Export(args) => cmd::export::run(args, console).await,
            Verb::Panel(verb) => cmd::panel::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Peers(args) => cmd::peers::run(&args, console).await,
            Verb::Reproduce(args) => cmd::reproduce::run(&args, console).await,
            Verb::Depth(verb) => cmd::depth::run(verb.args, &verb.options.chosen()?, console).await,
            Verb::Models(args) => cmd::models::run(&args, console),
            Verb::Zones(verb) => cmd::zones::run(&verb.args, &verb.options.chosen()?, console),
            Verb::Capture(verb) => cmd::capture::run(&verb.args, &verb.options.chosen()?, console).await,
            Verb::Calibrate(args) => cmd::calibrate::run(&args, console).await,
            Verb::Camera(args) => cmd::camera::run(args, console).await,
            Verb::Rig(args) => cmd::rig::run(&args, console),
            Verb::Target(args) => cmd::target::run(&args, console),
            Verb::Completions(args) => cmd::completions::run(&args, console),
        }
    });
    // A computation that an interrupted verb left behind must not hold up the end of the program.
    runtime.shutdown_background();
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(line: &str) -> String {
        let arguments = line.split(' ').map(OsString::from).collect();
        after_verb(arguments).iter().map(|argument| argument.to_string_lossy()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn options_before_the_verb_are_those_of_the_verb() {
        assert_eq!(moved("vergence --port sim --json home"), "vergence --json home --port sim");
        assert_eq!(moved("vergence --rig=a.toml config get x"), "vergence config get x --rig=a.toml");
        assert_eq!(moved("vergence --lease 1s run -- --port"), "vergence run --lease 1s -- --port");
        assert_eq!(moved("vergence home --port sim"), "vergence home --port sim");
        assert_eq!(moved("vergence --port"), "vergence --port");
        assert_eq!(moved("vergence"), "vergence");
    }

    #[test]
    fn every_verb_belongs_to_one_task() {
        let mut named: Vec<&str> = TASKS.iter().flat_map(|(_, verbs)| verbs.iter().copied()).collect();
        named.sort_unstable();
        let command = command();
        let mut verbs: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        verbs.sort_unstable();
        assert_eq!(named, verbs);
        command.debug_assert();
    }
}
