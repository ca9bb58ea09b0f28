//! `vergence run`: measures live, while the stages stand or move.

mod cameras;
mod tour;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use vergence_protocol::{Request, Trigger};
use vergence_rig::Rig;

use self::tour::Tour;
use super::connect::{connect, port};
use super::move_to::is_referenced;
use crate::board::{Board, fresh_session};
use crate::cli::Globals;
use crate::cmd::camera_options::CameraOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::link::{HostClock, Port};
use crate::live::{Ended, Exposures, Limits, LiveLoop, Publisher, Totals, Unplugged};
use crate::models::MatcherOptions;
use crate::output::{TableFormat, make_folder};
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, board_of};

/// News of cameras that may wait: more frames than that are lost, and their numbers tell.
const NEWS_KEPT: usize = 16;

/// Pairs the frames of both cameras, matches them and triangulates, again and again: a cloud of the newest pair whenever the
/// matcher is free, in the frame of the left camera. Nothing queues, and no cloud holds anything of an older one; what is
/// skipped is counted by reason.
///
/// The board fires the cameras (--rate), and every row is measured with the axes where they were when it was exposed, so that
/// the stages may move: with --mode they do. When a camera dies, the other's corners come as bearings, without range, until it
/// is back. Ctrl-C brakes, disarms and ends.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// So many pulses of the camera trigger each second, 0.1 to 500.
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = super::trigger::parse_rate)]
    rate: f64,
    /// The cameras are not fired but run freely; frames are paired by their time stamps.
    #[arg(long)]
    free: bool,
    /// A folder for `cloud.ply`, always the newest.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Keep every cloud, in files with numbers.
    #[arg(long, requires = "out")]
    keep: bool,
    /// Write points and bearings as tables too.
    #[arg(long, requires = "out", value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableFormat>,
    /// End after so many results.
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// End after so many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    seconds: Option<Duration>,
    #[command(flatten)]
    tour: tour::Options,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    camera: CameraOptions,
    /// Of simulated cameras: where the stages stand at first, and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Of simulated cameras: one is unplugged for a while of its life, such as left@2s..4s.
    #[arg(long, value_name = "WHEN")]
    unplug: Vec<Unplugged>,
    /// On a simulated rig: how much of its time matching takes. Without it, as much as it really took.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    match_time: Option<Duration>,
}

fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.ok_or_else(|| format!("'{text}' is no number of seconds"))
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let tour = args.tour.read(&rig)?;
    let matcher = Arc::from(args.matching.matcher(console)?);
    if let Some(folder) = &args.out {
        make_folder(folder)?;
    }
    let (mut board, simulated) = connected(args, globals, &rig, console).await?;
    // Frames and pulses are told apart on the clock of the link.
    let clock = board.as_ref().map_or_else(HostClock::start, |board| board.client().clock());
    if let Some(board) = &mut board {
        board.compare_clocks().await?;
        tour.home(board).await?;
        if !is_referenced(board) {
            return Err(Failure::device(
                "the axes have no reference, so nobody knows where the cameras are: run 'vergence home', or add --home",
            ));
        }
        for sentence in rig.extrapolations(&board.positions()) {
            console.warn(sentence);
        }
    }
    let period = (board.is_some() && !args.free).then_some(1e6 / args.rate);
    let (listener, news) = mpsc::channel(NEWS_KEPT);
    cameras::start(args, &rig, simulated.as_ref(), clock, &listener)?;
    // The loop ends when nobody tells it anything any more.
    drop(listener);
    let rig = Arc::new(rig);
    let mut live = LiveLoop {
        rig: Arc::clone(&rig),
        matcher,
        news,
        marks: period.and(board.as_mut()).map(|board| board.client_mut().take_marks()),
        board: board.as_ref().map(|board| board.client().knowledge()),
        clock,
        exposures: Exposures::new(period),
        simulated: simulated.is_some().then_some(args.match_time),
    };
    let mut publisher =
        Publisher { console, rig, out: args.out.clone(), keep: args.keep, also: args.also.clone(), number: 0 };
    let mut totals = Totals::default();
    if let (Some(board), Some(period)) = (&board, period) {
        board.ask(Request::SetTrigger(Trigger::Every { period_us: period.round() as u32 })).await?;
    }
    let ended = both(args, &mut live, &tour, &mut board, &mut publisher, &mut totals).await;
    let settled = settle(&mut board, &tour).await;
    publisher.end(&totals)?;
    let ended = ended?;
    settled?;
    match ended {
        Ended::Done => Ok(()),
        Ended::Blind => Err(Failure::device("both cameras are dead: see what was said of each above")),
    }
}

/// Measures while the stages go where they are sent, until one of both ends it or Ctrl-C is pressed.
async fn both(
    args: &Args,
    live: &mut LiveLoop,
    tour: &Tour,
    board: &mut Option<Board>,
    publisher: &mut Publisher,
    totals: &mut Totals,
) -> Result<Ended, Failure> {
    let console = publisher.console;
    let limits = Limits { results: args.frames, time: args.seconds };
    let measuring = live.run(limits, totals, |told| publisher.publish(&told), |warning| console.warn(warning));
    tokio::select! {
        ended = measuring => ended,
        failure = tour.drive(board.as_mut()) => Err(failure),
        () = interrupted() => Ok(Ended::Done),
    }
}

/// Leaves the board as it was found: at rest, disarmed, the cameras not fired.
async fn settle(board: &mut Option<Board>, tour: &Tour) -> Result<(), Failure> {
    let Some(board) = board else { return Ok(()) };
    if tour.moves() {
        board.release().await?;
    }
    board.ask(Request::SetTrigger(Trigger::Off)).await
}

/// The board, where the rig has axes; beside it the mechanics, where they are simulated.
async fn connected(
    args: &Args,
    globals: &Globals,
    rig: &Rig,
    console: Console,
) -> Result<(Option<Board>, Option<SharedRig>), Failure> {
    let wants_simulated = args.cameras == ["sim"];
    if rig.axes.is_empty() {
        return match wants_simulated {
            true => Err(Failure::usage(format!("rig '{}' has no axes to simulate", rig.name))),
            false => Ok((None, None)),
        };
    }
    match (port(globals)?, wants_simulated) {
        (Port::Simulated, true) => {
            let simulated = SharedRig::new(SimulatedRig::new(rig, args.seed)?);
            let (session, progress) = (fresh_session()?, console.progress("live"));
            let board = board_of(&simulated, rig.clone(), session, globals.lease, progress).await?;
            Ok((Some(board), Some(simulated)))
        }
        (_, false) if globals.port.as_deref() != Some("sim") => {
            Ok((Some(connect(globals, console, "live").await?), None))
        }
        _ => Err(Failure::usage("on a simulated rig ride simulated cameras: --port sim --cameras sim")),
    }
}
