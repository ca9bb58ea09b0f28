//! `vergence monitor`: poses as they come.

mod live;

use indicatif::ProgressBar;
use serde_json::Value;

use self::live::Live;
use super::connect::connect_with;
use super::reconnect::Listening;
use super::report::{clock_json, pose_json};
use crate::board::{Board, describe_fault, describe_pose};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Shows the axes as they move until Ctrl-C: one line each on a terminal, elsewhere a line for each pose (JSON Lines with
/// --json). It only reads. When the link ends, it waits until the board is back.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Stop after this many poses.
    #[arg(long)]
    count: Option<u64>,
    #[command(flatten)]
    listening: Listening,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let board = connect_with(globals, ProgressBar::hidden()).await?;
    let mut left = args.count.unwrap_or(u64::MAX);
    args.listening.to(board, globals, console, async |board| show(board, &mut left, console).await).await
}

async fn show(board: &mut Board, left: &mut u64, console: Console) -> Result<(), Failure> {
    let mut live = console.is_live().then(|| Live::new(board.rig()));
    while *left > 0 {
        board.next_pose().await?;
        match &mut live {
            Some(live) => live.draw(board),
            None => console.say(line(board))?,
        }
        if console.is_json() {
            console.result(&json_line(board))?;
        }
        *left -= 1;
    }
    Ok(())
}

fn line(board: &Board) -> String {
    let (rig, pose) = (board.rig(), board.pose());
    let fault = pose.fault.map(|fault| format!("  {}", describe_fault(rig, &fault))).unwrap_or_default();
    format!("{:10.3} s  {}{fault}", pose.at.0 as f64 * 1e-6, describe_pose(rig, pose))
}

/// The pose, when it was on both clocks, and what the link lost.
fn json_line(board: &Board) -> Value {
    let mut line = pose_json(board.rig(), board.pose());
    line["host_us"] = board.pose_on_host_clock().map(|host| host.us.round()).into();
    line["clock"] = clock_json(board);
    line["poses_lost"] = board.client().statistics().poses_lost.into();
    line
}
