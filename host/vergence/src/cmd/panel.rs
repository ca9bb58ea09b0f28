//! `vergence panel`: the page on which people see and drive the rig.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args as _, FromArgMatches};
use serde_json::json;
use vergence_board::BoardError;
use vergence_live::MatchingTime;
use vergence_panel::{Panel, Session, Setting, Shown, listen};
use vergence_peers::Published;
use vergence_scene::LensChoice;

use super::connect::connect;
use super::live_options::LiveOptions;
use super::peer_options::PublishOptions;
use super::publish::{seen_to_the_end, tell, tell_recorded};
use super::reconnect::Persistence;
use super::relink::Relink;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::stopwatch::started_us;

/// The lease on a simulated board in this process, in milliseconds: a busy computer must not stop it.
const SIMULATED_LEASE_MS: u16 = 1000;

/// Serves a page on which people see and drive the rig: modes, axes and a stop, both images with their matches, the cloud, what is seen
/// and how well depth would be known, plots and log. Open the address that it prints in a browser.
///
/// One page drives, the others watch; every page has the stop, also on the space bar. When the page that drives is closed or silent, the
/// rig stops. Motion goes the way of the other verbs: armed under a lease, planned by the board, disarmed afterwards. Without cameras
/// nothing is measured. When the link to the board ends, the page shows for how long, the last pose is used for ten seconds, and the board is
/// reached again; nothing moves then. Ctrl-C brakes, disarms and ends.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; two folders of images or Y4M videos; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// The address at which the page is served; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value_t = SocketAddr::from(([127, 0, 0, 1], 8088)))]
    listen: SocketAddr,
    /// Lets other computers in, which need the token in the address that is printed: --listen 0.0.0.0:8088 --network.
    #[arg(long)]
    network: bool,
    /// Finds the reference of all axes first.
    #[arg(long)]
    home: bool,
    /// With cameras: record images, encoders and clouds in this folder from when the axes have their reference, as a ROS 2 bag that
    /// `vergence replay` measures and shows again.
    #[arg(long, value_name = "DIR", requires = "cameras")]
    record: Option<PathBuf>,
    #[command(flatten)]
    live: LiveOptions,
    #[command(flatten)]
    persistence: Persistence,
    #[command(flatten)]
    publishing: PublishOptions,
}

/// `vergence demo --panel`: the same as `vergence panel --port sim --cameras sim --home`.
///
/// # Errors
/// As [`run`].
pub async fn demonstrate(
    (listen, lens, seed): (SocketAddr, LensChoice, u64),
    common: &CommonOptions,
    console: Console,
) -> Result<(), Failure> {
    let [listen, lens, seed] = [listen.to_string(), lens.to_string(), seed.to_string()];
    let line = ["panel", "--cameras", "sim", "--home", "--listen", &listen, "--lens", &lens, "--seed", &seed];
    let usage = |error: clap::Error| Failure::usage(error.to_string());
    let matches = Args::augment_args(clap::Command::new("panel")).try_get_matches_from(line).map_err(usage)?;
    let args = Args::from_arg_matches(&matches).map_err(usage)?;
    run(&args, &CommonOptions { port: Some("sim".into()), ..common.clone() }, console).await
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (listener, access) = listen(args.listen, args.network)?;
    let is_simulated = args.cameras == ["sim"];
    let (panel, session, relink) = match args.cameras.as_slice() {
        [] => {
            let rig = Arc::new(rig_file::load(common.rig.as_deref())?);
            let (panel, driver) = Panel::new(Setting { rig, simulated: None, has_cameras: false, recorded_ms: None });
            let board = panel.watching(connect(common, console, "panel").await?);
            let relink = args.persistence.persists().then(|| Relink::of_board(&board, common));
            (panel, Session { driver, board: Some(board), trigger: None, live: None, recording: None }, relink)
        }
        cameras => {
            let lease = if is_simulated { SIMULATED_LEASE_MS } else { common.lease };
            let common = &CommonOptions { lease, ..common.clone() };
            let (mut rig, method) = args.live.connect(cameras, common, None, console).await?;
            let simulated =
                is_simulated.then(|| format!("mechanics, room and cameras, lenses {}", args.live.taking.lens));
            let shown = Arc::clone(&method.measuring);
            let (panel, driver) = Panel::new(Setting { rig: shown, simulated, has_cameras: true, recorded_ms: None });
            rig.board = rig.board.map(|board| panel.watching(board));
            let recording = args.record.as_deref().map(|folder| rig.record(folder)).transpose()?;
            let events = panel.tap(args.live.taking.start_cameras(cameras, &rig, console)?, recording.as_ref());
            let (relink, marks) = Relink::of(args.persistence, &mut rig, common);
            let live = Some(method.live_loop(&rig, events, marks, MatchingTime::Real));
            (panel, Session { driver, board: rig.board, trigger: rig.trigger, live, recording }, relink)
        }
    };
    let panel = match args.publishing.read()? {
        Some((name, ways)) => Published::of(&panel, &session, started_us).with_panel(panel, name, ways)?,
        None => panel,
    };
    let serving = panel.serve(listener, access)?;
    console.say(format!("the panel is at {}; Ctrl-C ends it", serving.url()))?;
    console.result(&json!({ "url": serving.url() }))?;
    if args.home {
        panel.home();
    }
    let reach = relink.as_ref().map(|relink| async |lost: BoardError| relink.reach(lost.into(), console).await);
    let Shown { ended, totals, recorded } = session.run(&panel, interrupted(), reach).await?;
    if !args.cameras.is_empty() {
        tell(&totals, console)?;
    }
    if let (Some(recorded), Some(folder)) = (recorded, &args.record) {
        tell_recorded(recorded, folder, console)?;
    }
    seen_to_the_end(Some(ended))
}
