//! `vergence status`: what the board is doing, and why it stopped.

mod why;

use serde_json::json;

use self::why::Story;
use super::connect::connect;
use super::report::{clock_json, describe_clock, pose_json, say_pose};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Reads the board without touching anything.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Also tell what led to the fault: the last things that the board's recorder kept.
    #[arg(long)]
    why: bool,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut board = connect(globals, console, "status").await?;
    board.compare_clocks().await?;
    let story = if args.why { Some(Story::read(&board).await?) } else { None };
    let info = board.info();
    let [major, minor, patch] = info.firmware;
    if console.is_json() {
        let mut status = pose_json(board.rig(), board.pose());
        status["board"] = json!(info.board.as_str());
        status["firmware"] = json!(format!("{major}.{minor}.{patch}"));
        status["build"] = json!(format!("{:016x}", info.build));
        status["reset"] = json!(format!("{:?}", info.reset));
        status["clock"] = clock_json(&board);
        if let Some(story) = &story {
            status["why"] = story.json(board.rig());
        }
        return console.result(&status);
    }
    console.say(format!("{} firmware {major}.{minor}.{patch}, rig '{}'", info.board, board.rig().name))?;
    console.say(describe_clock(&board))?;
    say_pose(console, board.rig(), board.pose())?;
    match story {
        Some(story) => story.tell(board.rig(), console),
        None => Ok(()),
    }
}
