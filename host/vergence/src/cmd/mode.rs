//! `vergence mode NAME`: goes to a vision mode of the rig.

use super::connect::connect;
use super::move_to::{Goal, go, named_mode};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Moves all axes to a mode that the rig file names, and waits until the encoders confirm it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Such as herbivore or human.
    name: String,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let mode = named_mode(&rig, &args.name)?;
    let goal = Goal { mode: mode.number, targets: mode.targets.clone() };
    let mut board = connect(globals, console, &args.name).await?;
    go(&mut board, &goal, console).await
}
