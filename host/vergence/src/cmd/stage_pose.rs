//! Poses of the stages: named on the command line, by a mode, or reached by a move.

use serde_json::json;
use vergence_board::{Board, check_range, describe_pose, pose_json};
use vergence_protocol::Mode;
use vergence_rig::{AxisPosition, Rig, axes_json};
use vergence_vision::{Angle, Length};

use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::armed;

/// A pose of the stages, of which some axes are named.
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
    /// Whether no axis is named.
    pub fn is_empty(&self) -> bool {
        self.baseline.is_none() && self.separation.is_none()
    }

    /// The named position of each axis of `rig`; `None` for an axis that is not named.
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
/// Where the rig has no such mode; the message names its modes.
pub fn named_mode<'a>(rig: &'a Rig, name: &str) -> Result<&'a vergence_rig::Mode, Failure> {
    rig.mode(name).ok_or_else(|| {
        let names: Vec<_> = rig.modes.iter().map(|mode| mode.name.as_str()).collect();
        let choice = match names.as_slice() {
            [] => "its rig file names no modes".to_owned(),
            names => format!("choose {}", names.join(" or ")),
        };
        Failure::usage(format!("rig '{}' has no mode '{name}': {choice}", rig.name))
    })
}

/// A pose to move to.
pub struct Goal {
    /// The mode's number, or zero.
    pub mode: Mode,
    /// The position of every axis.
    pub targets: Vec<AxisPosition>,
}

/// Arms, moves, disarms, and prints the pose that was reached.
///
/// # Errors
/// Those of the board.
pub async fn go(board: &mut Board, goal: &Goal, console: Console) -> Result<(), Failure> {
    check_range(board.rig(), &goal.targets)?;
    armed(board, async |board| Ok(board.move_to(goal.mode, &goal.targets).await?)).await?;
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
