//! `vergence clear`: clears a latched fault or lost link.

use super::connect::connect;
use super::report::say_pose;
use crate::board::describe_fault;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Clears the latched fault, says what it was, and leaves the board disarmed.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "clearing").await?;
    match board.clear().await? {
        Some(fault) => console.say(format!("cleared: {}", describe_fault(board.rig(), &fault)))?,
        None => console.say("there was nothing to clear")?,
    }
    say_pose(console, board.rig(), board.pose())
}
