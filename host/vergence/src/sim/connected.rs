//! A simulated rig and the program that drives it, in one process.

use indicatif::ProgressBar;
use vergence_board::{Board, Client, HostClock, OpenWire, spawn_in_process};
use vergence_protocol::SessionId;
use vergence_rig::Rig;

use super::SharedRig;
use crate::console::shown_on;
use crate::failure::Failure;

/// Connects to the board of `simulated` by the real protocol; `drawn` is what the host believes of the rig. A seeded
/// `session` keeps even that the same in every run.
///
/// # Errors
/// A rig that is not that board's.
pub async fn board_of(
    simulated: &SharedRig,
    drawn: Rig,
    session: SessionId,
    lease_ms: u16,
    progress: ProgressBar,
) -> Result<Board, Failure> {
    let wire = OpenWire::in_process(spawn_in_process(simulated.clone()));
    let client = Client::connect(wire, session, HostClock::start()).await?;
    let board = Board::new(client, drawn, lease_ms).await?;
    Ok(board.observed(shown_on(progress)))
}
