//! `vergence peers`: the rigs that other machines publish.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use serde_json::json;
use tokio::time::{interval, sleep};
use vergence_panel::serve_rigs;

use super::peer_options::PeerOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};

/// Watches the rigs that other machines publish (--publish): a line for each, every second, or a page. With --mode it sends one to a mode.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The names of the rigs; without one, all that are there.
    rigs: Vec<String>,
    /// Serves a page with all of them at this address of this computer; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS")]
    page: Option<SocketAddr>,
    /// Sends the one rig to this mode, waits until it is there, and ends. It needs --peer-secret.
    #[arg(long, value_name = "MODE")]
    mode: Option<String>,
    /// Ends after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    peers: PeerOptions,
}

pub async fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let (network, secret) = args.peers.read()?;
    let watching = Arc::new(vergence_peers::watch(&args.rigs, &network, secret)?);
    if let Some(mode) = args.mode.clone() {
        let [rig] = args.rigs.clone().try_into().map_err(|_| Failure::usage("--mode is for one rig: name it"))?;
        let said = format!("rig '{rig}' is in mode '{mode}'");
        return tokio::select! {
            done = on_own_thread(move || Ok(watching.mode(&rig, &mode)?)) => done.and_then(|()| console.say(said)),
            () = interrupted() => Err(Failure::interrupted("interrupted: the rig hears no more of it, and stops in 2 s")),
        };
    }
    let page = args.page.map(|address| serve_rigs(watching.clone(), address)).transpose()?;
    if let Some(serving) = &page {
        console.say(format!("the rigs are at {}; Ctrl-C ends it", serving.url()))?;
        console.result(&json!({ "kind": "page", "url": serving.url() }))?;
    }
    let mut every = interval(Duration::from_secs(1));
    let watch = async {
        loop {
            every.tick().await;
            console.say_lines(watching.rigs.lines())?;
            console.result(&watching.rigs.json())?;
        }
    };
    tokio::select! {
        failed = watch => failed,
        () = sleep(args.duration.unwrap_or(Duration::MAX)) => Ok(()),
        () = interrupted() => Ok(()),
    }
}
