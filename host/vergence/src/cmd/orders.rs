//! Short orders to a board: `vergence arm`, `disarm`, `clear`, `home` and `mode`.

use std::time::Duration;

use vergence_board::describe_fault;

use super::connect::connect;
use super::reconnect::{Persistence, reconnect};
use super::stage_pose::{Goal, go, named_mode};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::{armed, interrupted};
use crate::rig_file;

/// Arms the board and holds its lease until Ctrl-C, then disarms. Other verbs arm by themselves. When the link ends, it
/// waits until the board is back and says how it stands, but does not arm it again.
#[derive(Debug, clap::Args)]
pub struct Arm {
    /// Disarms after this time instead.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    persistence: Persistence,
}

pub async fn arm(args: &Arm, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut board = connect(common, console, "arming").await?;
    let held = armed(&mut board, async |board| {
        console.say(match args.duration {
            Some(_) => "armed",
            None => "armed; Ctrl-C disarms",
        })?;
        Ok(board.hold(args.duration).await?)
    })
    .await;
    match held {
        Ok(()) => console.say_pose(board.rig(), board.pose()),
        // This is how it is meant to end: the board is disarmed now.
        Err(ended) if ended.kind() == FailureKind::Interrupted => console.say_pose(board.rig(), board.pose()),
        Err(lost) if args.persistence.survives(&lost) => {
            drop(board);
            tokio::select! {
                board = reconnect(common, console, lost) => {
                    let board = board?;
                    console.say_pose(board.rig(), board.pose())?;
                    Err(Failure::link("the link ended while the board was armed; it is back, and nothing was armed again"))
                }
                () = interrupted() => Err(Failure::link("interrupted before the board came back")),
            }
        }
        Err(failure) => Err(failure),
    }
}

/// Disarms the board: motors off, reference kept. A moving board brakes first.
#[derive(Debug, clap::Args)]
pub struct Disarm {}

pub async fn disarm(_: &Disarm, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut board = connect(common, console, "disarming").await?;
    board.disarm().await?;
    console.say_pose(board.rig(), board.pose())
}

/// Clears the latched fault, says what it was, and leaves the board disarmed.
#[derive(Debug, clap::Args)]
pub struct Clear {}

pub async fn clear(_: &Clear, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut board = connect(common, console, "clearing").await?;
    match board.clear().await? {
        Some(fault) => console.say(format!("cleared: {}", describe_fault(board.rig(), &fault)))?,
        None => console.say("there was nothing to clear")?,
    }
    console.say_pose(board.rig(), board.pose())
}

/// Seeks the home switch of every axis, approaches it again slowly, and moves to the low end of the range.
#[derive(Debug, clap::Args)]
pub struct Home {}

pub async fn home(_: &Home, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut board = connect(common, console, "homing").await?;
    armed(&mut board, async |board| Ok(board.home().await?)).await?;
    console.say_pose(board.rig(), board.pose())
}

/// Moves all axes to a mode that the rig file names, and waits until the encoders confirm it.
#[derive(Debug, clap::Args)]
pub struct Mode {
    /// The mode, such as herbivore or human.
    name: String,
}

pub async fn mode(args: &Mode, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(common.rig.as_deref())?;
    let mode = named_mode(&rig, &args.name)?;
    let goal = Goal { mode: mode.number, targets: mode.targets.clone() };
    let mut board = connect(common, console, &args.name).await?;
    go(&mut board, &goal, console).await
}
