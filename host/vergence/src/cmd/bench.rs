//! `vergence bench`: how fast we are, beside others on the same work.

mod peer_opencv;
mod vision;

use crate::console::Console;
use crate::failure::Failure;

/// Measures this program and others on the same work, in one run.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Projection, unprojection and triangulation of whole arrays, beside OpenCV.
    Vision(vision::Args),
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Vision(args) => vision::run(args, console),
    }
}
