//! `vergence status`: what the board is doing, and why it stopped.

use serde_json::json;
use vergence_board::{Followed, Follower, Story, clock_json, describe_clock, hex, pose_json};

use super::connect::{connect, port};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Reads the state of the board and changes nothing.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Also prints what led to the fault: the last events in the board's recorder.
    #[arg(long)]
    why: bool,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if !args.why
        && let Some(driver) = Follower::attach(&port(common)?).await
    {
        return say_followed(driver, common, console).await;
    }
    let mut board = connect(common, console, "status").await?;
    board.compare_clocks().await?;
    let key = board.trusted_key().await?;
    if key.is_some_and(|key| key.is_development()) {
        console.warn("the board takes firmware of the development key, for which anybody can sign: docs/flashing.md");
    }
    for axis in board.open_limits().await? {
        console.warn(format!("the hard limit switches of {axis} are normally open: a broken wire goes unnoticed"));
    }
    let story = if args.why { Some(Story::read(&board).await?) } else { None };
    let drivers = board.drivers().await?;
    let encoders = board.encoders().await?;
    let info = board.info();
    let [major, minor, patch] = info.firmware;
    if console.is_json() {
        let mut status = pose_json(board.rig(), board.pose());
        status["board"] = json!(info.board.as_str());
        status["firmware"] = json!(format!("{major}.{minor}.{patch}"));
        status["build"] = json!(format!("{:016x}", info.build));
        status["reset"] = json!(format!("{:?}", info.reset));
        status["key"] = json!(key.map(|key| if key.is_development() { "development".into() } else { hex(&key.0) }));
        status["clock"] = clock_json(&board);
        if !drivers.is_empty() {
            status["drivers"] = drivers.iter().map(|(axis, state)| (axis.clone(), json!(state.to_string()))).collect();
        }
        if !encoders.is_empty() {
            status["encoders"] =
                encoders.iter().map(|(axis, state)| (axis.clone(), json!(state.to_string()))).collect();
        }
        if let Some(story) = &story {
            status["why"] = story.json(board.rig());
        }
        return console.result(&status);
    }
    console.say(format!("{} firmware {major}.{minor}.{patch}, rig '{}'", info.board, board.rig().name))?;
    console.say(describe_clock(&board))?;
    console.say_pose(board.rig(), board.pose())?;
    for (axis, state) in drivers {
        console.say(format!("motor driver of {axis}: {state}"))?;
    }
    for (axis, state) in encoders {
        console.say(format!("encoder of {axis}: {state}"))?;
    }
    console.say_lines(story.iter().flat_map(|story| story.lines(board.rig())))
}

/// Says where the board is by what its driver passes on; nothing is asked of the board.
async fn say_followed(mut driver: Follower, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(common.rig.as_deref())?;
    loop {
        if let Followed::Pose(pose) = driver.next().await? {
            console.say("another vergence holds the port; this is what it passes on")?;
            return console.say_pose(&rig, &pose);
        }
    }
}
