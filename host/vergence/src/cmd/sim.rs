//! `vergence sim`: a simulated board for other programs.

use std::path::PathBuf;

use serde_json::json;
use vergence_board::Shared;
use vergence_files::write_whole;
use vergence_rig::Rig;

use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{DEVELOPMENT, PublicKey};
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::sim::{KeptRig, Listener, Served, SharedRig, SimulatedRig, serve, simulated_chip};

/// Runs the controller core against simulated mechanics in real time and prints the port to give to other verbs.
/// The motors, screws, encoders and switches are simulated; controller and protocol are the real ones. With --elf the
/// processor is simulated too, and runs the firmware as it is flashed.
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
    #[arg(long, value_name = "FILE", conflicts_with = "elf")]
    flash: Option<PathBuf>,
    /// Take firmware that is signed by this key: a file of 'image keygen', or the key that everybody knows. The simulator
    /// plays the board's part of an update; what runs is always itself, under the name of the image.
    #[arg(long, value_name = "FILE.pub", default_value = DEVELOPMENT)]
    trust: PathBuf,
    /// Run this program on a simulated STM32G474: an ELF file, or a signed image. For a start through the boot loader, and
    /// for updates, give the boot loader's ELF file, and then a signed image.
    #[arg(long, value_name = "FIRMWARE")]
    elf: Vec<PathBuf>,
    /// The fastest speed that the simulated serial adapter makes, in bits per second: at a faster one nobody is understood,
    /// as where a cable or a bridge cannot follow.
    #[arg(long, value_name = "BAUD", requires = "elf")]
    adapter: Option<u32>,
    /// Write what all wired pins did to this file when the simulation ends (value change dump, some megabytes for each
    /// second of motion).
    #[arg(long, value_name = "FILE", requires = "elf")]
    trace: Option<PathBuf>,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(common.rig.as_deref())?;
    if !args.elf.is_empty() {
        return run_firmware(args, &rig, console).await;
    }
    let mut simulated = SimulatedRig::new(&rig, args.seed)?;
    simulated.trust(PublicKey::named(&args.trust)?.0);
    match &args.flash {
        Some(file) => serve_until_interrupted(args, Shared::new(KeptRig::new(simulated, file)?), console).await,
        None => serve_until_interrupted(args, SharedRig::new(simulated), console).await,
    }
}

async fn run_firmware(args: &Args, rig: &Rig, console: Console) -> Result<(), Failure> {
    let mut chip = simulated_chip(&args.elf, rig, args.seed)?;
    if args.trace.is_some() {
        chip.trace();
    }
    if let Some(fastest) = args.adapter {
        chip.limit_adapter(fastest);
    }
    let chip = Shared::new(chip);
    let outcome = serve_until_interrupted(args, chip.clone(), console).await;
    if let Some(path) = &args.trace {
        write_whole(path, chip.lock().trace_dump().as_bytes())?;
    }
    outcome
}

async fn serve_until_interrupted<B>(args: &Args, board: Shared<B>, console: Console) -> Result<(), Failure>
where
    B: Served<Error: Into<Failure>>,
{
    let listener = match &args.tcp {
        Some(address) => Listener::tcp(address).await?,
        None => Listener::pty()?,
    };
    let port = listener.port().map_err(|error| Failure::device(format!("the simulated port has no name: {error}")))?;
    console.say(format!("simulated board at {port}\ntry: vergence --port {port} home"))?;
    console.result(&json!({ "port": port }))?;
    tokio::select! {
        outcome = serve(board, listener) => Ok(outcome?),
        () = interrupted() => Ok(()),
    }
}
