//! `vergence monitor`: poses as they come.

use std::time::Duration;

use tokio::time::timeout;

use super::connect::connect;
use super::report::pose_json;
use crate::board::{Board, describe_fault, describe_pose};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Prints a line for each pose (JSON Lines with --json) until Ctrl-C. It only reads.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Stop after this many poses.
    #[arg(long)]
    count: Option<u64>,
    /// Stop after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "monitor").await?;
    let forever = Duration::from_secs(u64::from(u32::MAX));
    tokio::select! {
        outcome = timeout(args.duration.unwrap_or(forever), show(&mut board, args.count, console)) => {
            outcome.unwrap_or(Ok(()))
        }
        _ = tokio::signal::ctrl_c() => Ok(()),
    }
}

async fn show(board: &mut Board, count: Option<u64>, console: Console) -> Result<(), Failure> {
    let mut shown = 0;
    while count.is_none_or(|count| shown < count) {
        let pose = board.next_pose().await?.clone();
        let fault = pose.fault.map(|fault| format!("  {}", describe_fault(board.rig(), &fault))).unwrap_or_default();
        console.say(format!("{:10.3} s  {}{fault}", pose.at.0 as f64 * 1e-6, describe_pose(board.rig(), &pose)))?;
        console.result(&pose_json(board.rig(), &pose))?;
        shown += 1;
    }
    Ok(())
}
