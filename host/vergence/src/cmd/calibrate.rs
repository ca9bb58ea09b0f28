//! `vergence calibrate`: cameras and pairs from boards, and calibrations compared.

mod diff;
mod extrinsics;
mod intrinsics;
mod views;

pub use views::parse_size;

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
    /// How far two calibrations of a camera differ over the field.
    Diff(diff::Args),
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Intrinsics(args) => intrinsics::run(args, console),
        Task::Extrinsics(args) => extrinsics::run(args, console),
        Task::Diff(args) => diff::run(args, console),
    }
}
