//! `vergence monitor`: poses as they come.

mod live;

use vergence_board::{Board, Followed, Follower, Source, describe_clock, pose_json, pose_line, pose_with_times_json};
use vergence_rig::Rig;

use self::live::Live;
use super::reconnect::Listening;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Prints the axes as they move until Ctrl-C: one line each on a terminal, elsewhere a line for each pose (JSON Lines with
/// --json). It only reads, and makes way for a verb that drives the board: it then shows the poses that this verb passes on.
/// When the link ends, it waits until the board is back.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Stops after this many poses.
    #[arg(long)]
    count: Option<u64>,
    #[command(flatten)]
    listening: Listening,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut left = args.count.unwrap_or(u64::MAX);
    let listen = async |source: Source<'_>| match source {
        Source::Board(board) => show(board, &mut left, console).await,
        Source::Driver(driver, rig) => show_followed(driver, rig, &mut left, console).await,
    };
    args.listening.to(common, console, listen).await
}

async fn show(board: &mut Board, left: &mut u64, console: Console) -> Result<(), Failure> {
    if board.axes().is_empty() {
        board.check_axes().await?;
    }
    let mut live = console.is_live().then(|| Live::new(board.rig()));
    while *left > 0 {
        board.next_pose().await?;
        match &mut live {
            Some(live) => {
                let lost = board.client().statistics().poses_lost;
                live.draw(board.rig(), board.pose(), format!("{}; {lost} poses lost", describe_clock(board)));
            }
            None => console.say(pose_line(board.rig(), board.pose()))?,
        }
        if console.is_json() {
            console.result(&pose_with_times_json(board))?;
        }
        *left -= 1;
    }
    Ok(())
}

/// Shows the poses that the driver of the board passes on. Only the driver compares the clocks.
async fn show_followed(driver: &mut Follower, rig: &Rig, left: &mut u64, console: Console) -> Result<(), Failure> {
    let mut live = console.is_live().then(|| Live::new(rig));
    while *left > 0 {
        let Followed::Pose(pose) = driver.next().await? else { continue };
        match &mut live {
            Some(live) => live.draw(rig, &pose, "another vergence drives the board".into()),
            None => console.say(pose_line(rig, &pose))?,
        }
        if console.is_json() {
            console.result(&pose_json(rig, &pose))?;
        }
        *left -= 1;
    }
    Ok(())
}
