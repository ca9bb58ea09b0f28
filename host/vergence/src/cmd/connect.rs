//! From the command line's options to a connected board.

use indicatif::ProgressBar;
use vergence_board::{Board, Client, HostClock, LinkError, OpenWire, Port, fresh_session, open};
use vergence_rig::Rig;

use crate::cli::Globals;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::rig_file;
use crate::serial_ports::{boards, ports};
use crate::sim::{SharedRig, SimulatedRig, spawn_in_process};

/// Where the stages of an in-process board stand.
const SIM_SEED: u64 = 1;

/// Connects to the board that the options name.
///
/// # Errors
/// No board, a board of another protocol or rig, a bad rig file.
pub async fn connect(globals: &Globals, console: Console, what: &str) -> Result<Board, Failure> {
    let board = connect_with(globals, console.progress(what)).await?;
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
pub async fn connect_with(globals: &Globals, progress: ProgressBar) -> Result<Board, Failure> {
    let (client, rig) = client(globals).await?;
    let board = Board::new(client, rig, globals.lease).await?;
    Ok(board.observed(shown_on(progress)))
}

/// Connects to a board that may not fit the rig file.
///
/// # Errors
/// No board, a board of another protocol, a bad rig file.
pub async fn connect_any(globals: &Globals, console: Console, what: &str) -> Result<Board, Failure> {
    let (client, rig) = client(globals).await?;
    let board = Board::open(client, rig, globals.lease).await?;
    Ok(noted(board.observed(shown_on(console.progress(what))), console))
}

/// Connects to a board that may not fit the rig file, without a sign of progress.
///
/// # Errors
/// No board, a board of another protocol, a bad rig file.
pub async fn connect_quietly(globals: &Globals, console: Console) -> Result<Board, Failure> {
    let (client, rig) = client(globals).await?;
    Ok(noted(Board::open(client, rig, globals.lease).await?, console))
}

async fn client(globals: &Globals) -> Result<(Client, Rig), Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let port = port(globals)?;
    let wire = wire(&port, globals.baud, &rig).await?;
    let client = Client::connect(wire, fresh_session()?, HostClock::start())
        .await
        .map_err(|error| Failure::device(format!("{port}: {}", unanswered(&port, &error))))?;
    Ok((client, rig))
}

/// Why nobody answered. A TCP address that could be reached has a simulator behind it, which serves one host at a time.
fn unanswered(port: &Port, error: &LinkError) -> String {
    match (port, error) {
        (Port::Tcp(_), LinkError::Silent(patience)) => format!(
            "connected, but no answer within {patience:?}: the port is in use by another vergence, or this is no vergence \
             board; let the other one finish first"
        ),
        _ => error.to_string(),
    }
}

/// The port that the options name, or the only one there is.
///
/// # Errors
/// None, or several.
pub fn port(globals: &Globals) -> Result<Port, Failure> {
    if let Some(Ok(port)) = globals.port.as_deref().map(str::parse) {
        return Ok(port);
    }
    let hint = "name one with --port, or run a simulated board with 'vergence sim --pty'";
    let found = boards()?;
    match found.as_slice() {
        [] => {
            let others: Vec<String> = ports()?.into_iter().map(|port| port.port_name).collect();
            let others = match others.as_slice() {
                [] => String::new(),
                others => format!(" ({} is not tried unless named)", others.join(", ")),
            };
            Err(Failure::device(format!("no serial device found on USB{others}: connect the board, or {hint}")))
        }
        [only] => Ok(Port::Serial(only.into())),
        several => Err(Failure::usage(format!("several serial devices found ({}): {hint}", several.join(", ")))),
    }
}

/// Whether bytes take time on this port: pseudo-terminals and TCP carry them at once.
#[must_use]
pub fn is_wire(globals: &Globals) -> bool {
    match port(globals) {
        // A name that a rule or a person gave to the device is still that device.
        Ok(Port::Serial(path)) => !path.canonicalize().unwrap_or(path).starts_with("/dev/pts"),
        _ => false,
    }
}

async fn wire(port: &Port, baud: u32, rig: &Rig) -> Result<OpenWire, Failure> {
    if *port == Port::Simulated {
        let simulated = SharedRig::new(SimulatedRig::new(rig, SIM_SEED)?);
        return Ok(OpenWire::in_process(spawn_in_process(simulated)));
    }
    Ok(open(port, baud, false).await?)
}
