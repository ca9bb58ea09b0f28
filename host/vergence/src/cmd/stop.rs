//! `vergence stop`: brakes now.

use std::future::pending;
use std::time::Duration;

use serde_json::json;
use tokio::io::AsyncWriteExt;
use vergence_board::{Followed, Follower, HostClock, OpenWire, Port, fresh_session, open};
use vergence_protocol::{ControllerState, HostSession, MAX_FRAME, Request, StopKind};

use super::connect::{connect_any, port};
use super::report::say_pose;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;
use crate::slots;

/// Decelerates every axis within its limits and keeps the reference. Needs no arming. It is software: the emergency stop
/// is the switch that cuts the drivers.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    if let port @ Port::Serial(_) = port(globals)? {
        let mut wire = open(&port, globals.baud, true).await?;
        if wire.lock.is_none() {
            return send_unheard(&port, wire, console).await;
        }
        // Before the session, which takes some round trips to open; the answer comes to the one after it.
        send_once(&port, &mut wire).await?;
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
    let rig = globals.rig.clone().or_else(|| slots::active_rig().ok().flatten());
    let rig = rig.filter(|path| rig_file::load(Some(path)).is_ok());
    Globals { rig, ..globals.clone() }
}

/// Another vergence reads this port and gets the answers: sends the stop until a pose that it passes on shows no motion.
async fn send_unheard(port: &Port, mut wire: OpenWire, console: Console) -> Result<(), Failure> {
    /// Sendings without a pose: so many are not all lost where one frame in fifty is.
    const BLIND: u32 = 10;
    /// Sendings in all: two seconds of them.
    const MOST: u32 = 100;
    const APART: Duration = Duration::from_millis(20);
    let mut follower = Follower::attach(port).await;
    for sent in 1..=MOST {
        send_once(port, &mut wire).await?;
        let heard = tokio::time::timeout(APART, next_state(&mut follower)).await.ok();
        // A pose may have been on its way when the first stop left.
        if let Some(state) = heard.filter(|state| sent > 1 && !is_driven(*state)) {
            console.say(format!("stopped: {state}"))?;
            return console.result(&json!({"stop": "sent", "confirmed": true, "state": state.to_string()}));
        }
        if heard.is_none() && sent >= BLIND {
            break;
        }
    }
    console.say("stop sent; the vergence that holds the port tells what became of it")?;
    console.result(&json!({"stop": "sent", "confirmed": false}))
}

/// Whether a board in this state has not taken a stop yet.
fn is_driven(state: ControllerState) -> bool {
    matches!(state, ControllerState::Moving | ControllerState::Homing)
}

/// The state in the next pose that the holder of the port passes on; never comes where there is none.
async fn next_state(follower: &mut Option<Follower>) -> ControllerState {
    while let Some(reports) = follower {
        match reports.next().await {
            Ok(Followed::Pose(pose)) => return pose.state,
            Ok(_) => {}
            Err(_) => *follower = None,
        }
    }
    pending().await
}

/// Sends one stop in a session of its own: the board takes a stop from anybody.
async fn send_once(port: &Port, wire: &mut OpenWire) -> Result<(), Failure> {
    let mut session = HostSession::new(fresh_session()?);
    let sent = session.send_now(Request::Stop { kind: StopKind::Decelerate });
    sent.map_err(|error| Failure::device(format!("the stop cannot be sent: {error}")))?;
    let mut frame = [0; MAX_FRAME];
    while let Some(length) = session.transmit(HostClock::start().now(), &mut frame) {
        let bytes = frame.get(..length).unwrap_or_default();
        wire.stream.write_all(bytes).await.map_err(|error| Failure::device(format!("{port}: {error}")))?;
    }
    wire.stream.flush().await.map_err(|error| Failure::device(format!("{port}: {error}")))
}
