//! `vergence disarm`: motors off, reference kept.

use super::connect::connect;
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Disarms the board; in motion it brakes first.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "disarming").await?;
    board.disarm().await?;
    say_pose(console, board.rig(), board.pose())
}
