//! `vergence move`: goes to any pose, or by a distance.

use vergence_board::{check_range, describe_pose, pose_json};
use vergence_protocol::Mode;
use vergence_rig::{AxisPosition, Rig, axes_json};

use super::connect::connect;
use super::stage_pose::{Goal, StagePose, go};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::armed;
use crate::rig_file;

/// Moves to an absolute pose, or with --by from where the stages stand; an axis that is not named stays where it is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Moves by these distances instead. This works before homing too, at homing speed: only the switches stop it then.
    #[arg(long)]
    by: bool,
    #[command(flatten)]
    stage: StagePose,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if args.stage.is_empty() {
        return Err(Failure::usage("say where to: --baseline 120mm, --separation 45deg, or both"));
    }
    let rig = rig_file::load(common.rig.as_deref())?;
    let named = args.stage.of_axes(&rig)?;
    if args.by {
        return go_by(&rig, &named, common, console).await;
    }
    // What is named is checked before the board is touched; the rest stays where it is.
    let certain: Vec<_> =
        named.iter().zip(&rig.axes).map(|(position, axis)| position.unwrap_or(axis.range[0])).collect();
    check_range(&rig, &certain)?;
    let mut board = connect(common, console, "moving").await?;
    let targets = named.iter().zip(board.standing()).map(|(named, present)| named.unwrap_or(present)).collect();
    go(&mut board, &Goal { mode: Mode(0), targets }, console).await
}

async fn go_by(
    rig: &Rig,
    named: &[Option<AxisPosition>],
    common: &CommonOptions,
    console: Console,
) -> Result<(), Failure> {
    let axes = named.iter().zip(&rig.axes);
    let by: Vec<_> = axes.map(|(by, axis)| by.unwrap_or(AxisPosition::from_value(axis.kind, 0.0))).collect();
    let mut board = connect(common, console, "moving").await?;
    if board.is_referenced() {
        let targets = board.standing().iter().zip(&by).map(|(before, &by)| before.plus(by)).collect::<Vec<_>>();
        check_range(rig, &targets)?;
    }
    let before = armed(&mut board, async |board| {
        // Arming puts the zero of an axis without reference where it stands.
        let before = board.positions();
        board.move_by(&by).await?;
        Ok(before)
    })
    .await?;
    let moved: Vec<_> = board.positions().iter().zip(&before).map(|(after, &before)| after.minus(before)).collect();
    console.say(describe_pose(rig, board.pose()))?;
    let ways = rig.axes.iter().zip(&moved).map(|(axis, moved)| format!("{} by {moved}", axis.name));
    console.say(format!("moved {}", ways.collect::<Vec<_>>().join(", ")))?;
    let mut result = pose_json(rig, board.pose());
    result["commanded_by"] = axes_json(rig, &by);
    result["moved_by"] = axes_json(rig, &moved);
    console.result(&result)
}
