//! `vergence home`: finds the reference of all axes.

use super::connect::connect;
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Seeks the home switch of every axis, approaches it again slowly, and goes to the low end of the range.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "homing").await?;
    board.armed(async |board| board.home().await).await?;
    say_pose(console, board.rig(), board.pose())
}
