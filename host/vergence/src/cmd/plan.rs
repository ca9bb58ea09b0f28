//! `vergence plan`: a pose before it is taken.

mod goal;

use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Plans and moves nothing.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    goal: goal::GoalOptions,
}

pub fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    goal::run(&args.goal, globals, console)
}
