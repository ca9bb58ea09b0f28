//! Drives the simulated rig over the real protocol: what its encoders read at every stop, and the truth.

use indicatif::ProgressBar;
use vergence_board::Board;
use vergence_protocol::{Mode, SessionId};
use vergence_reproduce::{Bench, Drive, Route, Stop};
use vergence_rig::AxisPosition;

use crate::failure::Failure;
use crate::sim::{SharedRig, SimulatedRig, board_of};

/// Lease of the simulated boards, in milliseconds.
const LEASE_MS: u16 = 100;

/// Homes the simulated rig of `bench` and drives it along its route, in virtual time. The same `seed` gives the same
/// readings.
///
/// # Errors
/// Those of the board.
pub async fn drive(bench: &Bench, seed: u64, progress: &ProgressBar) -> Result<Drive, Failure> {
    let simulated = SharedRig::new(SimulatedRig::new(&bench.built, seed)?);
    let session = SessionId((seed as u32).max(1));
    let mut board = board_of(&simulated, bench.drawn.clone(), session, LEASE_MS, progress.clone()).await?;
    let route = Route::of(bench);
    board
        .armed(std::future::pending(), async |board| -> Result<Drive, Failure> {
            board.home().await?;
            let mut drive = Drive { calibration: Vec::new(), modes: Vec::new() };
            for (stops, targets) in [(&mut drive.calibration, &route.calibration), (&mut drive.modes, &route.modes)] {
                for (mode, targets) in targets {
                    stops.push(stop(board, &simulated, *mode, targets).await?);
                }
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
