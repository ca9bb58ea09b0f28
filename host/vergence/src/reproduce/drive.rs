//! Drives the simulated rig: what its encoders read where it was calibrated and used, and the truth.

use indicatif::ProgressBar;
use vergence_protocol::{Mode, SessionId};
use vergence_rig::AxisPosition;
use vergence_vision::{Left, Right, Transform};

use super::bench::{Bench, MODES};
use crate::board::Board;
use crate::failure::Failure;
use crate::sim::{SharedRig, SimulatedRig, board_of};
use crate::stage_plan::stage_plan;

/// Stage poses of a calibration.
const STAGE_POSES: usize = 6;

/// Where the stage came to stand.
#[derive(Clone, Debug)]
pub struct Stop {
    /// What the encoders read.
    pub readings: Vec<AxisPosition>,
    /// Where the right camera really is.
    pub truth: Transform<Left, Right>,
}

/// All stops of one seed.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Where the stage is calibrated.
    pub calibration: Vec<Stop>,
    /// Where the bench measures, one for each of [`MODES`].
    pub modes: Vec<Stop>,
}

/// Homes a simulated rig, drives it through the poses of a stage calibration and then into the bench's modes, over the
/// real protocol and controller, in virtual time.
///
/// # Errors
/// Those of the board.
pub async fn drive(bench: &Bench, seed: u64, lease_ms: u16, progress: &ProgressBar) -> Result<Drive, Failure> {
    let simulated = SharedRig::new(SimulatedRig::new(&bench.built, seed)?);
    let session = SessionId((seed as u32).max(1));
    let mut board = board_of(&simulated, bench.drawn.clone(), session, lease_ms, progress.clone()).await?;
    let plan = stage_plan(&bench.drawn.axes, STAGE_POSES);
    let modes = MODES.iter().filter_map(|name| bench.drawn.mode(name)).map(|mode| (mode.number, mode.targets.clone()));
    let modes: Vec<_> = modes.collect();
    board
        .armed(async |board| {
            board.home().await?;
            let mut drive = Drive { calibration: Vec::new(), modes: Vec::new() };
            for targets in &plan {
                drive.calibration.push(stop(board, &simulated, Mode(0), targets).await?);
            }
            for (number, targets) in &modes {
                drive.modes.push(stop(board, &simulated, *number, targets).await?);
            }
            Ok(drive)
        })
        .await
}

async fn stop(board: &mut Board, rig: &SharedRig, mode: Mode, targets: &[AxisPosition]) -> Result<Stop, Failure> {
    board.move_to(mode, targets).await?;
    board.next_pose().await?;
    Ok(Stop { readings: board.positions(), truth: rig.lock().true_pose().left_from_right })
}
