//! `vergence run` measures live, while the stages stand still or move; `vergence record` keeps the same without measuring.

pub mod record;
mod tour;

use std::path::PathBuf;
use std::time::Duration;

use vergence_board::Board;
use vergence_live::{Ended, Limits, LiveLoop, MatchingTime, Notice, Totals, Tour};
use vergence_peers::Published;
use vergence_protocol::{Request, Trigger};

use super::live_options::LiveOptions;
use super::taking_options::LiveRig;
use crate::cli::CommonOptions;
use crate::cmd::peer_options::PublishOptions;
use crate::cmd::publish::{Publisher, seen_to_the_end, tell, tell_notice, tell_recorded};
use crate::cmd::reconnect::Persistence;
use crate::cmd::relink::Relink;
use crate::cmd::result_options::ResultOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::interrupted;
use crate::stopwatch::Stopwatch;

/// Pairs the images of both cameras, matches and triangulates them, again and again: a cloud of the newest pair whenever the
/// matcher is free, in the frame of the left camera. Nothing queues, and no cloud holds anything of an older one; skipped
/// exposures are counted by reason.
///
/// The board fires the cameras (--rate). Every row is measured with the pose at its own exposure, so the stages may move: with
/// --mode they do. When a camera dies, the corners of the other are written as bearings, without range, until it is back. When an
/// encoder is lost, the board stops and the images tell that axis, until a line `home` on standard input clears the fault and homes. When
/// the link to the board ends, the last pose is used for ten seconds, less and less surely, and the board is reached again; nothing moves then.
/// Ctrl-C brakes, disarms and ends.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; two folders of images or Y4M videos; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    #[command(flatten)]
    results: ResultOptions,
    /// Measures every pixel of a pair too, while the cameras stand: `dense.ply` with ranges and their sigma as PNG images in the folder of --out.
    #[arg(long)]
    dense: bool,
    /// Record images, encoders, clouds and warnings in this folder, as a ROS 2 bag that `vergence replay` measures again.
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// End after this many results.
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// End after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = parse_time, alias = "seconds")]
    duration: Option<Duration>,
    #[command(flatten)]
    tour: tour::Options,
    #[command(flatten)]
    live: LiveOptions,
    #[command(flatten)]
    persistence: Persistence,
    /// On a simulated rig: how long matching takes on its clock. Without it, as long as it really takes.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    match_time: Option<Duration>,
    #[command(flatten)]
    publishing: PublishOptions,
}

/// A time such as `2s` or `90s`; a bare number is seconds.
fn parse_time(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    seconds.map_or_else(|| humantime::parse_duration(text).map_err(|error| error.to_string()), Ok)
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let files = args.results.files()?;
    let (mut rig, method) = args.live.connect(&args.cameras, common, args.results.out.as_deref(), console).await?;
    let tour = args.tour.tour(&rig.known)?;
    let recording = args.record.as_deref().map(|folder| rig.record(folder)).transpose()?;
    let board = rig.board.as_ref().map(|board| board.client().knowledge());
    let published = Published { rig: method.measuring.clone(), board, clock: rig.clock, epoch_us: rig.epoch_us };
    let publication = args.publishing.start(published)?;
    make_ready(&mut rig, &args.tour, console).await?;
    let is_simulated = rig.simulated.is_some();
    let matching_time = match (is_simulated, args.match_time) {
        (false, _) => MatchingTime::Real,
        (true, None) => MatchingTime::Measured,
        (true, Some(time)) => MatchingTime::Fixed(time),
    };
    let events = args.live.taking.start_cameras(&args.cameras, &rig, console)?;
    let (relink, marks) = Relink::of(args.persistence, &mut rig, common);
    let mut live = method.live_loop(&rig, events, marks, matching_time);
    if let Some(recording) = &recording {
        live = recording.of(live);
    }
    live.dense = args.dense;
    let (mut board, trigger) = (rig.board, rig.trigger);
    let mut publisher = Publisher {
        console,
        rig: method.measuring,
        lens: is_simulated.then_some(args.live.taking.lens),
        files,
        number: 0,
        clock: live.clock,
        recorder: recording.as_ref().map(|recording| recording.recorder.clone()),
        publication,
    };
    let (mut totals, measuring) = (Totals::default(), Stopwatch::start());
    if let (Some(board), Some(trigger)) = (&board, trigger) {
        board.ask(Request::SetTrigger(trigger)).await?;
    }
    let driven = drive(&tour, &mut board, relink.as_ref(), console);
    let ended = both(args, &mut live, driven, &mut publisher, &mut totals).await;
    // A simulated board ends with this process, and its time stands still as long as the matcher works.
    let settled = match (&ended, is_simulated) {
        (Ok(None), true) => Ok(()),
        _ => settle(&mut board, &tour).await,
    };
    tell(&totals, console)?;
    if is_simulated {
        let rate = (totals.clouds + totals.bearings) as f64 / measuring.seconds();
        console.say(format!("{rate:.1} results a second of real time, with all that is simulated"))?;
    }
    if let (Some(recording), Some(folder)) = (recording, &args.record) {
        tell_recorded(recording.finish().await?, folder, console)?;
    }
    let ended = ended?;
    settled?;
    seen_to_the_end(ended)
}

/// Compares the clocks, homes where that is asked for, and says where calibration reaches no pose.
async fn make_ready(rig: &mut LiveRig, tour: &tour::Options, console: Console) -> Result<(), Failure> {
    let Some(board) = &mut rig.board else { return Ok(()) };
    board.compare_clocks().await?;
    tour.home(board).await?;
    if !board.is_referenced() {
        return Err(Failure::device(
            "the axes have no reference, so nobody knows where the cameras are: run 'vergence home', or add --home",
        ));
    }
    rig.known.extrapolations(&board.positions()).iter().for_each(|sentence| console.warn(sentence));
    Ok(())
}

/// Measures while the stages go where they are sent, until either ends; `None` where the program is asked to end.
async fn both(
    args: &Args,
    live: &mut LiveLoop,
    driven: impl Future<Output = Failure>,
    publisher: &mut Publisher,
    totals: &mut Totals,
) -> Result<Option<Ended>, Failure> {
    let console = publisher.console;
    let limits = Limits { results: args.frames, time: args.duration };
    let warn = |notice: Notice| tell_notice(&notice, console);
    let measuring = live.run(limits, totals, |result| publisher.publish(&result), warn);
    tokio::select! {
        ended = measuring => ended.map(Some),
        failure = driven => Err(failure),
        () = interrupted() => Ok(None),
    }
}

/// Sends the stages where `tour` goes, until something fails. After a link that ended, the board is reached again, and nothing moves any more.
async fn drive(tour: &Tour, board: &mut Option<Board>, relink: Option<&Relink>, console: Console) -> Failure {
    let (mut tour, still) = (tour, Tour::default());
    let warn = |warning: String| console.warn(warning);
    loop {
        let failure = Failure::from(tour.drive(board.as_mut(), interrupted(), tour::order(), warn).await);
        let Some(relink) = relink.filter(|_| failure.kind() == FailureKind::Link) else { return failure };
        // Its port is free only without it.
        *board = None;
        match relink.reach(failure, console).await {
            Ok(reached) => *board = Some(reached),
            Err(failure) => return failure,
        }
        tour = &still;
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
