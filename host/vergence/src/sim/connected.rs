//! A simulated rig and the program that drives it, in one process.

use indicatif::ProgressBar;
use vergence_protocol::SessionId;
use vergence_rig::Rig;

use super::{SharedRig, spawn_in_process};
use crate::board::Board;
use crate::failure::Failure;
use crate::link::{Client, HostClock, OpenWire};

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
    Board::new(client, drawn, lease_ms, progress).await
}
