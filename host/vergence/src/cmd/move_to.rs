//! `vergence move`: goes to any pose, or by a distance.

use serde_json::json;
use vergence_protocol::{AxisMask, Mode};
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Angle, Length};

use super::connect::connect;
use super::report::{axes_json, pose_json};
use crate::board::{Board, check_range, describe_pose};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Moves to an absolute pose, or with --by from where the stages stand; an axis that is not named stays where it is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Go by these distances instead. Works before homing too, at homing speed: no limit but the switches stops it then.
    #[arg(long)]
    by: bool,
    #[command(flatten)]
    stage: StagePose,
}

/// A pose of the bench's stages.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct StagePose {
    /// Distance of the cameras, such as 120mm.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub baseline: Option<Length>,
    /// Angle between the optical axes, such as 45deg.
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    pub separation: Option<Angle>,
}

impl StagePose {
    /// Whether nothing is named.
    pub fn is_empty(&self) -> bool {
        self.baseline.is_none() && self.separation.is_none()
    }

    /// What is named for each axis of `rig`.
    ///
    /// # Errors
    /// Where the rig has no such axis, or it is of another kind.
    pub fn of_axes(&self, rig: &Rig) -> Result<Vec<Option<AxisPosition>>, Failure> {
        let named = [
            ("baseline", self.baseline.map(AxisPosition::Linear)),
            ("separation", self.separation.map(AxisPosition::Rotary)),
        ];
        let mut positions = vec![None; rig.axes.len()];
        for (name, position) in named {
            let Some(position) = position else { continue };
            let axis = rig.axes.iter().zip(&mut positions).find(|(axis, _)| axis.name == name);
            let Some((axis, slot)) = axis else {
                return Err(Failure::usage(format!("rig '{}' has no axis '{name}'", rig.name)));
            };
            if !position.is_of(axis.kind) {
                return Err(Failure::usage(format!("axis '{name}' of rig '{}' is of another kind", rig.name)));
            }
            *slot = Some(position);
        }
        Ok(positions)
    }
}

/// The mode that the rig file names `name`.
///
/// # Errors
/// Names the modes there are.
pub fn named_mode<'a>(rig: &'a Rig, name: &str) -> Result<&'a vergence_rig::Mode, Failure> {
    rig.mode(name).ok_or_else(|| {
        let names: Vec<_> = rig.modes.iter().map(|mode| mode.name.as_str()).collect();
        Failure::usage(format!("rig '{}' has no mode '{name}': choose {}", rig.name, names.join(" or ")))
    })
}

/// Where to go.
pub struct Goal {
    /// The mode's number, or zero.
    pub mode: Mode,
    /// Of every axis.
    pub targets: Vec<AxisPosition>,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    if args.stage.is_empty() {
        return Err(Failure::usage("say where to: --baseline 120mm, --separation 45deg, or both"));
    }
    let rig = rig_file::load(globals.rig.as_deref())?;
    let named = args.stage.of_axes(&rig)?;
    if args.by {
        return go_by(&rig, &named, globals, console).await;
    }
    // What is named is checked before the board is touched; the rest stays where it is.
    let certain: Vec<_> =
        named.iter().zip(&rig.axes).map(|(position, axis)| position.unwrap_or(axis.range[0])).collect();
    check_range(&rig, &certain)?;
    let mut board = connect(globals, console, "moving").await?;
    let targets = named.iter().zip(board.standing()).map(|(named, present)| named.unwrap_or(present)).collect();
    go(&mut board, &Goal { mode: Mode(0), targets }, console).await
}

async fn go_by(rig: &Rig, named: &[Option<AxisPosition>], globals: &Globals, console: Console) -> Result<(), Failure> {
    let axes = named.iter().zip(&rig.axes);
    let by: Vec<_> = axes.map(|(by, axis)| by.unwrap_or(AxisPosition::from_value(axis.kind, 0.0))).collect();
    let mut board = connect(globals, console, "moving").await?;
    let before = board.positions();
    if is_referenced(&board) {
        let targets = board.standing().iter().zip(&by).map(|(before, &by)| before.plus(by)).collect::<Vec<_>>();
        check_range(rig, &targets)?;
    }
    board.armed(async |board| board.move_by(&by).await).await?;
    let moved: Vec<_> = board.positions().iter().zip(&before).map(|(after, &before)| after.minus(before)).collect();
    console.say(describe_pose(rig, board.pose()))?;
    let ways = rig.axes.iter().zip(&moved).map(|(axis, moved)| format!("{} by {moved}", axis.name));
    console.say(format!("moved {}", ways.collect::<Vec<_>>().join(", ")))?;
    let mut result = pose_json(rig, board.pose());
    result["commanded_by"] = axes_json(rig, &by);
    result["moved_by"] = axes_json(rig, &moved);
    console.result(&result)
}

/// Whether every axis knows where it is.
pub fn is_referenced(board: &Board) -> bool {
    board.pose().referenced == AxisMask::first(board.rig().axes.len())
}

/// Arms, moves, disarms, and says what was reached.
///
/// # Errors
/// Those of the board.
pub async fn go(board: &mut Board, goal: &Goal, console: Console) -> Result<(), Failure> {
    check_range(board.rig(), &goal.targets)?;
    board.armed(async |board| board.move_to(goal.mode, &goal.targets).await).await?;
    let reached = board.positions();
    let off: Vec<_> = reached.iter().zip(&goal.targets).map(|(reached, &target)| reached.minus(target)).collect();
    console.say(describe_pose(board.rig(), board.pose()))?;
    let differences = board.rig().axes.iter().zip(&off).map(|(axis, off)| format!("{} {off}", axis.name));
    console.say(format!("off the goal by {}", differences.collect::<Vec<_>>().join(", ")))?;
    let mut result = pose_json(board.rig(), board.pose());
    result["commanded"] = axes_json(board.rig(), &goal.targets);
    result["achieved"] = axes_json(board.rig(), &reached);
    result["difference"] = axes_json(board.rig(), &off);
    result["reached"] = json!(true);
    console.result(&result)
}
