//! `vergence arm`: holds the motors.

use std::time::Duration;

use super::connect::connect;
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Arms the board and holds its lease until Ctrl-C, then disarms. Other verbs arm by themselves.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Disarm after this time instead.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "arming").await?;
    board
        .armed(async |board| {
            console.say(match args.duration {
                Some(_) => "armed",
                None => "armed; Ctrl-C disarms",
            })?;
            board.hold(args.duration).await
        })
        .await?;
    say_pose(console, board.rig(), board.pose())
}
