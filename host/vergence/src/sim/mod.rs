//! Simulated boards for the command: read from files, served, and driven in this process.

mod files;
mod robot;

use indicatif::ProgressBar;
use vergence_board::{Board, BoardError, Shared};
use vergence_protocol::SessionId;
use vergence_rig::Rig;

use crate::console::shown_on;

pub use files::{KeptRig, simulated_chip};
pub use robot::SimulatedRobot;
pub use vergence_board::{Listener, Served, serve, spawn_in_process};
pub use vergence_sim::{Random, SimulatedChip, SimulatedRig, built};

/// A simulated rig, shared between the task that serves it and the cameras on it.
pub type SharedRig = Shared<SimulatedRig>;

/// Connects to the board of `simulated` as [`Board::in_process`], and shows its poses on `progress`.
///
/// # Errors
/// A rig that is not that board's.
pub async fn board_of(
    simulated: &SharedRig,
    drawn: Rig,
    session: SessionId,
    lease_ms: u16,
    progress: ProgressBar,
) -> Result<Board, BoardError> {
    let board = Board::in_process(simulated.clone(), drawn, session, lease_ms).await?;
    Ok(board.observed(shown_on(progress)))
}
