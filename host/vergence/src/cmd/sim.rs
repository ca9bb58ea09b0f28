//! `vergence sim`: a simulated board for other programs.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{DEVELOPMENT, PublicKey};
use crate::rig_file;
use crate::sim::{Listener, SharedRig, SimulatedRig, serve};

/// Runs the controller core against simulated mechanics in real time and prints the port to give to other verbs.
/// The motors, screws, encoders and switches are simulated; controller and protocol are the real ones.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Serve on a pseudo-terminal (the default).
    #[arg(long, conflicts_with = "tcp")]
    pty: bool,
    /// Serve on a TCP address instead, such as 127.0.0.1:4545; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS")]
    tcp: Option<String>,
    /// Decides where the stages stand at the start.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep saved settings in this file, so that they outlive the simulator.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Take firmware that is signed by this key: a file of 'image keygen', or the key that everybody knows. The simulator
    /// plays the board's part of an update; what runs is always itself, under the name of the image.
    #[arg(long, value_name = "FILE.pub", default_value = DEVELOPMENT)]
    trust: PathBuf,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let mut simulated = SimulatedRig::new(&rig, args.seed)?;
    simulated.trust(PublicKey::named(&args.trust)?.0);
    if let Some(path) = &args.flash {
        simulated.keep_flash_in(path)?;
    }
    let simulated = SharedRig::new(simulated);
    let listener = match &args.tcp {
        Some(address) => Listener::tcp(address).await?,
        None => Listener::pty()?,
    };
    let port = listener.port().map_err(|error| Failure::device(format!("the simulated port has no name: {error}")))?;
    console.say(format!("simulated board at {port}\ntry: vergence --port {port} home"))?;
    console.result(&json!({ "port": port }))?;
    tokio::select! {
        outcome = serve(simulated, listener) => outcome,
        _ = tokio::signal::ctrl_c() => Ok(()),
    }
}
