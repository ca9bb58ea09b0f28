//! `vergence stop`: brakes now.

use std::time::Duration;

use serde_json::json;
use tokio::io::AsyncWriteExt;
use vergence_board::{HostClock, OpenWire, Port, fresh_session, open};
use vergence_protocol::{HostSession, MAX_FRAME, Request, StopKind};

use super::connect::{connect_any, port};
use super::options::active_rig;
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Decelerates every axis within its limits and keeps the reference. Needs no arming. It is software: the emergency stop
/// is the switch that cuts the drivers.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    if let port @ Port::Serial(_) = port(globals)? {
        let wire = open(&port, globals.baud, true).await?;
        if wire.lock.is_none() {
            return send_unheard(&port, wire, console).await;
        }
    }
    let mut board = connect_any(&with_readable_rig(globals), console, "stopping").await?;
    board.stop().await?;
    // Only now does it matter whether positions can be told.
    if board.check_axes().await.is_ok() {
        return say_pose(console, board.rig(), board.pose());
    }
    console.say(format!("{}; the rig file does not describe this board", board.pose().state))?;
    console.result(&json!({ "state": board.pose().state.to_string() }))
}

/// A rig file that cannot be read is no reason not to stop.
fn with_readable_rig(globals: &Globals) -> Globals {
    let rig = globals.rig.clone().or_else(|| active_rig().ok().flatten());
    let rig = rig.filter(|path| rig_file::load(Some(path)).is_ok());
    Globals { rig, ..globals.clone() }
}

/// Another vergence reads this port: send the stop a few times and leave the answers to it.
async fn send_unheard(port: &Port, mut wire: OpenWire, console: Console) -> Result<(), Failure> {
    const REPEATS: u32 = 3;
    const APART: Duration = Duration::from_millis(20);
    let clock = HostClock::start();
    for _ in 0..REPEATS {
        let mut session = HostSession::new(fresh_session()?);
        let sent = session.send_now(Request::Stop { kind: StopKind::Decelerate });
        sent.map_err(|error| Failure::device(format!("the stop cannot be sent: {error}")))?;
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = session.transmit(clock.now(), &mut frame) {
            let bytes = frame.get(..length).unwrap_or_default();
            wire.stream.write_all(bytes).await.map_err(|error| Failure::device(format!("{port}: {error}")))?;
        }
        tokio::time::sleep(APART).await;
    }
    console.say("stop sent; the vergence that holds the port tells what became of it")?;
    console.result(&json!({"stop": "sent", "confirmed": false}))
}
