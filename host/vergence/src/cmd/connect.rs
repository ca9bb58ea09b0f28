//! From the command line's options to a connected board.

use indicatif::ProgressBar;
use vergence_board::{Board, Client, Continuity, OpenWire, Port, fresh_session, open};
use vergence_rig::Rig;

use crate::cli::CommonOptions;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::rig_file;
use crate::sim::{SharedRig, simulated_rig, spawn_in_process};

/// Where the stages of an in-process board stand.
const SIM_SEED: u64 = 1;

/// Connects to the board that the options name.
///
/// # Errors
/// No board, a board of another protocol or rig, a bad rig file.
pub async fn connect(common: &CommonOptions, console: Console, what: &str) -> Result<Board, Failure> {
    let board = connect_with(common, console.progress(what)).await?;
    Ok(noted(board, console))
}

/// Says where the board had to be asked for more than it is set to.
fn noted(board: Board, console: Console) -> Board {
    if let Some(note) = board.stream_note() {
        console.warn(note);
    }
    board
}

/// The same, with another sign of progress.
///
/// # Errors
/// As of [`connect`].
pub async fn connect_with(common: &CommonOptions, progress: ProgressBar) -> Result<Board, Failure> {
    let (client, rig) = client(common, None).await?;
    let board = Board::new(client, rig, common.lease).await?;
    Ok(board.observed(shown_on(progress)))
}

/// Connects to a board again, after a link of this continuity.
///
/// # Errors
/// As of [`connect`].
pub async fn connect_again(common: &CommonOptions, continuity: Continuity) -> Result<Board, Failure> {
    let (client, rig) = client(common, Some(continuity)).await?;
    Ok(Board::new(client, rig, common.lease).await?)
}

/// Connects to a board that may not fit the rig file.
///
/// # Errors
/// No board, a board of another protocol, a bad rig file.
pub async fn connect_any(common: &CommonOptions, console: Console, what: &str) -> Result<Board, Failure> {
    let (client, rig) = client(common, None).await?;
    let board = Board::open(client, rig, common.lease).await?;
    Ok(noted(board.observed(shown_on(console.progress(what))), console))
}

/// Connects to a board that may not fit the rig file, without a sign of progress.
///
/// # Errors
/// No board, a board of another protocol, a bad rig file.
pub async fn connect_quietly(common: &CommonOptions, console: Console) -> Result<Board, Failure> {
    let (client, rig) = client(common, None).await?;
    Ok(noted(Board::open(client, rig, common.lease).await?, console))
}

async fn client(common: &CommonOptions, continuity: Option<Continuity>) -> Result<(Client, Rig), Failure> {
    let rig = rig_file::load(common.rig.as_deref())?;
    let port = port(common)?;
    let wire = wire(&port, common.baud, &rig).await?;
    let continuity = continuity.unwrap_or_else(|| Continuity::begin(wire.baud));
    Ok((Client::at(&port, wire, fresh_session()?, continuity).await?, rig))
}

/// The port that the options name, or the only one there is.
///
/// # Errors
/// None, or several.
pub fn port(common: &CommonOptions) -> Result<Port, Failure> {
    Ok(Port::named_or_only(common.port.as_deref())?)
}

/// Whether bytes take time on this port: pseudo-terminals and TCP carry them at once.
#[must_use]
pub fn is_wire(common: &CommonOptions) -> bool {
    port(common).is_ok_and(Port::is_wire)
}

async fn wire(port: &Port, baud: u32, rig: &Rig) -> Result<OpenWire, Failure> {
    if let Port::Simulated(firmware) = port {
        let simulated = SharedRig::new(simulated_rig(firmware.as_deref(), rig, SIM_SEED)?);
        return Ok(OpenWire::in_process(spawn_in_process(simulated)));
    }
    Ok(open(port, baud, false).await?)
}
