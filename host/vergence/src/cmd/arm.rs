//! `vergence arm`: holds the motors.

use std::time::Duration;

use super::connect::connect;
use super::reconnect::{Persistence, reconnect};
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;

/// Arms the board and holds its lease until Ctrl-C, then disarms. Other verbs arm by themselves. When the link ends, it
/// waits until the board is back and says how it stands, but does not arm it again.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Disarm after this time instead.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    persistence: Persistence,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "arming").await?;
    let held = board
        .armed(async |board| {
            console.say(match args.duration {
                Some(_) => "armed",
                None => "armed; Ctrl-C disarms",
            })?;
            board.hold(args.duration).await
        })
        .await;
    match held {
        Ok(()) => say_pose(console, board.rig(), board.pose()),
        Err(lost) if args.persistence.survives(&lost) => {
            drop(board);
            tokio::select! {
                board = reconnect(globals, console, lost) => {
                    let board = board?;
                    say_pose(console, board.rig(), board.pose())?;
                    Err(Failure::link("the link ended while the board was armed; it is back, and nothing was armed again"))
                }
                () = interrupted() => Err(Failure::link("interrupted before the board came back")),
            }
        }
        Err(failure) => Err(failure),
    }
}
