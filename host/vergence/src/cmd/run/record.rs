//! `vergence record`: keeps what the rig sees and says, without measuring.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::json;
use vergence_live::Limits;
use vergence_protocol::Request;
use vergence_rig::rounded;

use super::{drive, make_ready, parse_time, settle, tour};
use crate::cli::CommonOptions;
use crate::cmd::publish::{seen_to_the_end, tell_recorded};
use crate::cmd::reconnect::Persistence;
use crate::cmd::relink::Relink;
use crate::cmd::taking_options::TakingOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;

/// Records the images of both cameras, the readings of the encoders and all events, without measuring: the ROS 2 bag of `vergence run --record`
/// without clouds. `vergence replay` measures it.
///
/// The board fires the cameras (--rate); with --mode the stages move meanwhile. When the link to the board ends, images are recorded on, and
/// the board is reached again; nothing moves then. Ctrl-C brakes, disarms and ends the recording in order.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; two folders of images or Y4M videos; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// The folder of the recording, which must be empty or not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// End after this many images of each camera.
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// End after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = parse_time, alias = "seconds")]
    duration: Option<Duration>,
    #[command(flatten)]
    tour: tour::Options,
    #[command(flatten)]
    taking: TakingOptions,
    #[command(flatten)]
    persistence: Persistence,
}

pub async fn record(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (mut rig, ()) = args.taking.connect(&args.cameras, common, None, console, |_| Ok(())).await?;
    let tour = args.tour.tour(&rig.known)?;
    let recording = rig.record(&args.out)?;
    make_ready(&mut rig, &args.tour, console).await?;
    let events = args.taking.start_cameras(&args.cameras, &rig, console)?;
    let (relink, marks) = Relink::of(args.persistence, &mut rig, common);
    if let (Some(board), Some(trigger)) = (&rig.board, rig.trigger) {
        board.ask(Request::SetTrigger(trigger)).await?;
    }
    let limits = Limits { results: args.frames, time: args.duration };
    let warn = |warning: String| console.warn(warning);
    let ended = tokio::select! {
        ended = recording.keep((events, marks), limits, warn) => ended.map(Some).map_err(Failure::from),
        failure = drive(&tour, &mut rig.board, relink.as_ref(), console) => Err(failure),
        () = interrupted() => Ok(None),
    };
    let settled = settle(&mut rig.board, &tour).await;
    let recorded = recording.finish().await?;
    tell_recorded(recorded, &args.out, console)?;
    let (images, left_out, gap) = (recorded.images, recorded.left_out.images, recorded.without_link.as_secs_f64());
    console.result(&json!({ "kind": "end", "images": images, "left_out": left_out, "link_lost_s": rounded(gap) }))?;
    let ended = ended?;
    settled?;
    seen_to_the_end(ended)
}
