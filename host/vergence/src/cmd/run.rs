//! `vergence run`: measures live, while the stages stand still or move.

mod cameras;
mod publish;
mod tour;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use vergence_board::{Board, HostClock, Port, fresh_session};
use vergence_files::make_folder;
use vergence_live::{Ended, Limits, LiveLoop, MatchingTime, Pace, Totals, Tour};
use vergence_output::{PlyEncoding, TableFormat, check_folder};
use vergence_pipeline::Exposures;
use vergence_protocol::{Request, Trigger};
use vergence_rig::Rig;
use vergence_scene::LensChoice;

use self::publish::Publisher;
use super::connect::{connect, port};
use crate::cli::CommonOptions;
use crate::cmd::camera_options::CameraOptions;
use crate::cmd::model_options::MatcherOptions;
use crate::cmd::options::TableOption;
use crate::cmd::search_options::SearchOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, board_of, lensed};
use crate::stopwatch::clock as stopwatch;

/// Number of camera events that may wait; images beyond it are lost, which the gap in their numbers shows.
const EVENTS_KEPT: usize = 16;

/// Pairs the images of both cameras, matches and triangulates them, again and again: a cloud of the newest pair whenever the
/// matcher is free, in the frame of the left camera. Nothing queues, and no cloud holds anything of an older one; skipped
/// exposures are counted by reason.
///
/// The board fires the cameras (--rate). Every row is measured with the pose at its own exposure, so the stages may move: with
/// --mode they do. When a camera dies, the corners of the other are written as bearings, without range, until it is back. When an
/// encoder is lost, the board stops and the images tell that axis, until a line `home` on standard input clears the fault and homes.
/// Ctrl-C brakes, disarms and ends.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// Pulses of the camera trigger per second, 0.1 to 500.
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = super::camera_options::parse_rate)]
    rate: f64,
    /// The cameras are not fired but run freely; images are paired by their time stamps.
    #[arg(long)]
    free: bool,
    /// The folder for `cloud.ply`, always the newest cloud.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep every cloud, in files with numbers.
    #[arg(long, requires = "out")]
    keep: bool,
    /// Write points and bearings as tables too.
    #[arg(long, requires = "out", value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableOption>,
    /// Write the PLY file as text, for a person to read; the default is binary.
    #[arg(long)]
    ascii: bool,
    /// End after this many results.
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// End after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = parse_time, alias = "seconds")]
    duration: Option<Duration>,
    #[command(flatten)]
    tour: tour::Options,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    search: SearchOptions,
    #[command(flatten)]
    camera: CameraOptions,
    /// With simulated cameras: sets where the stages stand at first and the noise of the images.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// With simulated cameras: their lenses, ideal, as the rig's file has them, or a published design that is traced, sigma8_f18 or nikkor6_f28. A
    /// rig with traced lenses is calibrated first, from simulated targets, and measured by the file that this gives, `rig.toml` in --out.
    #[arg(long, default_value_t)]
    lens: LensChoice,
    /// With simulated cameras: unplugs one, or the encoder of an axis, for a while, such as left@2s..4s after the start.
    #[arg(long, value_name = "WHEN")]
    unplug: Vec<vergence_sim::Unplug>,
    /// On a simulated rig: how long matching takes on its clock. Without it, as long as it really takes.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    match_time: Option<Duration>,
}

/// A time such as `2s` or `90s`; a bare number is seconds.
fn parse_time(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.map_or_else(|| humantime::parse_duration(text).map_err(|error| error.to_string()), Ok)
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let is_simulated = args.cameras == ["sim"];
    let drawn = rig_file::load(common.rig.as_deref())?;
    let drawn = if is_simulated { args.camera.simulated(drawn)? } else { drawn };
    if args.lens != LensChoice::Ideal && !is_simulated {
        return Err(Failure::usage("--lens is for simulated cameras: --port sim --cameras sim"));
    }
    if let Some(folder) = &args.out {
        check_folder(folder)?;
        make_folder(folder)?;
    }
    let (rig, lenses) = match is_simulated {
        true => {
            let lensed = lensed(&drawn, (args.lens, args.seed), args.out.as_deref(), console).await?;
            (lensed.known, Some(lensed.lenses))
        }
        false => (drawn.clone(), None),
    };
    let (tour, search) = (args.tour.tour(&rig)?, args.search.search(&rig)?);
    // A simulated camera shows nothing beyond the field in which it is known.
    let measuring = Arc::new(args.search.measuring(rig.clone())?);
    let matcher = Arc::from(args.matching.live(console)?);
    let (mut board, simulated) = connected(args, common, [&drawn, &rig], console).await?;
    // Images and pulses are stamped on the clock of the link.
    let clock = board.as_ref().map_or_else(HostClock::start, |board| board.client().clock());
    if let Some(board) = &mut board {
        board.compare_clocks().await?;
        args.tour.home(board).await?;
        if !board.is_referenced() {
            return Err(Failure::device(
                "the axes have no reference, so nobody knows where the cameras are: run 'vergence home', or add --home",
            ));
        }
        for sentence in rig.extrapolations(&board.positions()) {
            console.warn(sentence);
        }
    }
    let period = (board.is_some() && !args.free).then_some(1e6 / args.rate);
    let (listener, events) = mpsc::channel(EVENTS_KEPT);
    cameras::start(args, &rig, simulated.as_ref().zip(lenses), clock, &listener)?;
    // The loop ends when no sender is left.
    drop(listener);
    let mut live = LiveLoop {
        rig: Arc::clone(&measuring),
        matcher,
        search: Arc::new(search),
        events,
        marks: period.and(board.as_mut()).map(|board| board.client_mut().take_marks()),
        board: board.as_ref().map(|board| board.client().knowledge()),
        clock,
        exposures: Exposures::new(period),
        matching_time: match (&simulated, args.match_time) {
            (None, _) => MatchingTime::Real,
            (Some(_), None) => MatchingTime::Measured,
            (Some(_), Some(time)) => MatchingTime::Fixed(time),
        },
        stopwatch,
        memory: Arc::default(),
    };
    let mut publisher = Publisher {
        console,
        rig: measuring,
        lens: is_simulated.then_some(args.lens),
        out: args.out.clone(),
        keep: args.keep,
        also: args.also.iter().copied().map(TableFormat::from).collect(),
        encoding: PlyEncoding::of(args.ascii),
        number: 0,
        pace: Pace::default(),
    };
    let mut totals = Totals::default();
    if let (Some(board), Some(period)) = (&board, period) {
        board.ask(Request::SetTrigger(Trigger::Every { period_us: period.round() as u32 })).await?;
    }
    let ended = both(args, &mut live, &tour, &mut board, &mut publisher, &mut totals).await;
    // A simulated board ends with this process, and its time stands still as long as the matcher works.
    let settled = match (&ended, &simulated) {
        (Ok(None), Some(_)) => Ok(()),
        _ => settle(&mut board, &tour).await,
    };
    publisher.end(&totals)?;
    let ended = ended?;
    settled?;
    match ended {
        Some(Ended::Done) | None => Ok(()),
        Some(Ended::Blind) => Err(Failure::device("both cameras are dead: see what was said of each above")),
    }
}

/// Measures while the stages go where they are sent, until either ends; `None` where the program is asked to end.
async fn both(
    args: &Args,
    live: &mut LiveLoop,
    tour: &Tour,
    board: &mut Option<Board>,
    publisher: &mut Publisher,
    totals: &mut Totals,
) -> Result<Option<Ended>, Failure> {
    let console = publisher.console;
    let limits = Limits { results: args.frames, time: args.duration };
    let warn = |warning: String| console.warn(warning);
    let measuring = live.run(limits, totals, |result| publisher.publish(&result), warn);
    tokio::select! {
        ended = measuring => ended.map(Some),
        error = tour.drive(board.as_mut(), interrupted(), tour::order(), warn) => Err(error.into()),
        () = interrupted() => Ok(None),
    }
}

/// Leaves the board at rest, disarmed, with the camera trigger off.
async fn settle(board: &mut Option<Board>, tour: &Tour) -> Result<(), Failure> {
    let Some(board) = board else { return Ok(()) };
    // A latched fault stays for whoever clears it; nothing moves, and the board cannot be disarmed.
    if tour.moves() && board.pose().fault.is_none() {
        board.release().await?;
    }
    Ok(board.ask(Request::SetTrigger(Trigger::Off)).await?)
}

/// The board, where the rig has axes; beside it the mechanics, where they are simulated: of the rig as drawn, while the board's is as known.
async fn connected(
    args: &Args,
    common: &CommonOptions,
    [drawn, rig]: [&Rig; 2],
    console: Console,
) -> Result<(Option<Board>, Option<SharedRig>), Failure> {
    let wants_simulated = args.cameras == ["sim"];
    if rig.axes.is_empty() {
        return match wants_simulated {
            true => Err(Failure::usage(format!("rig '{}' has no axes to simulate", rig.name))),
            false => Ok((None, None)),
        };
    }
    match (port(common)?, wants_simulated) {
        (Port::Simulated, true) => {
            let simulated = SharedRig::new(SimulatedRig::new(drawn, args.seed)?);
            let (session, progress) = (fresh_session()?, console.progress("live"));
            let board = board_of(&simulated, rig.clone(), session, common.lease, progress).await?;
            Ok((Some(board), Some(simulated)))
        }
        (_, false) if common.port.as_deref() != Some("sim") => {
            Ok((Some(connect(common, console, "live").await?), None))
        }
        _ => Err(Failure::usage("a simulated rig has simulated cameras: --port sim --cameras sim")),
    }
}
