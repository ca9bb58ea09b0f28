//! Simulated boards for the command: read from files, served, and driven in this process.

mod files;
mod robot;

use std::path::Path;

use indicatif::ProgressBar;
use vergence_board::{Board, BoardError, Shared};
use vergence_files::write_whole;
use vergence_protocol::SessionId;
use vergence_reproduce::LensedRig;
use vergence_rig::Rig;
use vergence_scene::LensChoice;

use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::interrupt::on_own_thread;

pub use files::{KeptRig, simulated_chip, simulated_rig};
pub use robot::SimulatedRobot;
pub use vergence_board::{Listener, Served, serve, spawn_in_process};
pub use vergence_sim::{Random, SimulatedChip, SimulatedRig, built};

/// The cable to a simulated rig in this process.
pub type Plug = vergence_board::Plug<SimulatedRig>;
/// A simulated rig, shared between the task that serves it and the cameras on it.
pub type SharedRig = Shared<SimulatedRig>;

/// The rig `drawn` with simulated lenses of this kind, which are calibrated where they are not the drawing's; says which they are. The file of the
/// calibrated rig goes to the folder `out`, as `rig.toml`.
///
/// # Errors
/// Traced lenses for a rig without stages that can be calibrated, or a file that cannot be written.
pub async fn lensed(
    drawn: &Rig,
    (lens, seed): (LensChoice, u64),
    out: Option<&Path>,
    console: Console,
) -> Result<LensedRig, Failure> {
    if lens != LensChoice::Ideal && drawn.trunk.is_some() {
        return Err(Failure::usage(format!("rig '{}' has a trunk: --lens {lens} is for rigs with stages", drawn.name)));
    }
    let drawn = drawn.clone();
    let lensed = on_own_thread(move || Ok(LensedRig::new(&drawn, lens, seed)?)).await?;
    match (&lensed.file, out) {
        (None, _) => console.say(format!("simulated lenses: {lens}, known exactly"))?,
        (Some(file), Some(folder)) => {
            let path = folder.join("rig.toml");
            write_whole(&path, file.as_bytes())?;
            console.say(format!("simulated lenses: {lens}; measured by their calibration, {}", path.display()))?;
        }
        (Some(_), None) => console.say(format!("simulated lenses: {lens}; measured by their calibration"))?,
    }
    Ok(lensed)
}

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
