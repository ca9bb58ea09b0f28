//! `vergence calibrate`: cameras, pairs and stages from boards; calibrations compared and kept.

mod diff;
mod extrinsics;
mod intrinsics;
mod options;
mod slots;
mod stage;
mod views;

pub use views::parse_size;

use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Calibrates from images of a chessboard or from corners in a CSV file. No initial guess is asked.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// One camera: lens parameters, their uncertainty and the valid field.
    Intrinsics(intrinsics::Args),
    /// A pair: where the right camera is, and how sure that is.
    Extrinsics(extrinsics::Args),
    /// A moving stage: its screws and encoders, for every pose that it can take.
    ///
    /// From a board seen at several stage poses: three suffice, six are recommended, each with a dozen views or more.
    /// --rig names the drawing: axes, modes and screws as they were meant.
    Stage(Box<stage::Args>),
    /// How far two calibrations of a camera differ over the field.
    Diff(diff::Args),
    /// The calibrations that are kept.
    List(slots::List),
    /// Make a kept calibration the active one.
    ///
    /// It is then the rig of every verb that is given no --rig. It is swapped whole or not at all.
    Use(slots::Use),
    /// Make the calibration active again that was so before.
    Rollback(slots::Rollback),
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Intrinsics(args) => intrinsics::run(args, console),
        Task::Extrinsics(args) => extrinsics::run(args, console),
        Task::Stage(args) => stage::run(args, globals, console).await,
        Task::Diff(args) => diff::run(args, console),
        Task::List(args) => slots::list(args, console),
        Task::Use(args) => slots::activate(args, console),
        Task::Rollback(args) => slots::rollback(args, console),
    }
}
