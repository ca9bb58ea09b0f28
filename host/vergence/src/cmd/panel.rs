//! `vergence panel`: the page on which people see and drive the rig.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;

use clap::{Args as _, FromArgMatches};
use serde_json::json;
use vergence_board::{fresh_secret, hex};
use vergence_live::{Ended, MatchingTime};
use vergence_panel::{Access, Panel, PanelError, Session, Setting};
use vergence_peers::Published;
use vergence_scene::LensChoice;

use super::connect::connect;
use super::live_options::LiveOptions;
use super::peer_options::PublishOptions;
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
/// nothing is measured. Ctrl-C brakes, disarms and ends.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; or `sim` on a simulated rig.
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
    #[command(flatten)]
    live: LiveOptions,
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
    let access = access(args.listen, args.network)?;
    let listener = listen(args.listen)?;
    let is_simulated = args.cameras == ["sim"];
    let (panel, session) = match args.cameras.as_slice() {
        [] => {
            let rig = Arc::new(rig_file::load(common.rig.as_deref())?);
            let (panel, driver) = Panel::new(Setting { rig, simulated: None, has_cameras: false });
            let board = Some(panel.watching(connect(common, console, "panel").await?));
            (panel, Session { driver, board, trigger: None, live: None })
        }
        cameras => {
            let lease = if is_simulated { SIMULATED_LEASE_MS } else { common.lease };
            let (mut rig, method) =
                args.live.connect(cameras, &CommonOptions { lease, ..common.clone() }, None, console).await?;
            let simulated =
                is_simulated.then(|| format!("mechanics, room and cameras, lenses {}", args.live.taking.lens));
            let (panel, driver) =
                Panel::new(Setting { rig: Arc::clone(&method.measuring), simulated, has_cameras: true });
            rig.board = rig.board.map(|board| panel.watching(board));
            let events = panel.tap(args.live.taking.start_cameras(cameras, &rig)?);
            let live = Some(method.live_loop(&mut rig, events, MatchingTime::Real));
            (panel, Session { driver, board: rig.board, trigger: rig.trigger, live })
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
    match session.run(&panel, interrupted()).await? {
        Ended::Done => Ok(()),
        Ended::Blind => Err(Failure::device("both cameras are dead: the log of the panel said why")),
    }
}

/// What accepts connections at `address`.
pub fn listen(address: SocketAddr) -> Result<TcpListener, PanelError> {
    TcpListener::bind(address).map_err(|error| PanelError::Listen { address, why: error.to_string() })
}

/// Who may connect to `address`: on a network, who knows a token that is new each time.
pub fn access(address: SocketAddr, network: bool) -> Result<Access, Failure> {
    match (network, address.ip().is_loopback()) {
        (true, _) => {
            let secret = fresh_secret().map_err(|error| Failure::device(error.to_string()))?;
            Ok(Access::Token(hex(&secret.public().0[..16])))
        }
        (false, true) => Ok(Access::ThisComputer),
        (false, false) => Err(Failure::usage(format!(
            "{address} lets other computers in: add --network, which makes a token that they need"
        ))),
    }
}
