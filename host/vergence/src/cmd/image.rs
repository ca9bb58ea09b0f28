//! `vergence image`: makes and shows firmware images.

mod info;
mod keygen;
mod sign;

use crate::console::Console;
use crate::failure::Failure;

/// Makes keys, signs firmware images and shows what they are. Boards take signed images only: see docs/flashing.md.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Make a new pair of keys: FILE, which signs and must stay secret, and FILE.pub, which boards trust.
    Keygen(keygen::Args),
    /// Make a signed image of an ELF file, or of the raw bytes for flash.
    Sign(sign::Args),
    /// Show what an image is, and whether its signature is valid. Exit code 1 where it is not.
    Info(info::Args),
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Keygen(args) => keygen::run(args, console),
        Task::Sign(args) => sign::run(args, console),
        Task::Info(args) => info::run(args, console),
    }
}
