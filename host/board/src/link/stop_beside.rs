//! Stops without a session: before one is open, and beside another program that reads the answers.

use std::future::pending;
use std::time::Duration;

use tokio::io::AsyncWriteExt;
use tokio::time::timeout;
use vergence_protocol::{ControllerState, HostSession, MAX_FRAME, Request, StopKind};

use super::clock::HostClock;
use super::error::OpenError;
use super::follow::{Followed, Follower};
use super::open::{OpenWire, Port};
use super::repeated_stop::REPEAT_US;
use super::session_id::fresh_session;

/// Number of times that a stop is sent without any pose: one of so many arrives even where one frame in fifty is lost.
const BLIND: u32 = 10;
/// Number of times that a stop is sent in all: for two seconds.
const MOST: u32 = 100;
/// Time between two of them.
const APART: Duration = Duration::from_micros(REPEAT_US);

/// Sends one stop over `wire`, which leads to `port`, in a session of its own: the board takes a stop from anybody.
///
/// # Errors
/// [`OpenError`] where it cannot be sent.
pub async fn send_stop(port: &Port, wire: &mut OpenWire) -> Result<(), OpenError> {
    let mut session = HostSession::new(fresh_session()?);
    let sent = session.send_now(Request::Stop { kind: StopKind::Decelerate });
    sent.map_err(|error| OpenError::NoStop(error.to_string()))?;
    let fail = |error: std::io::Error| OpenError::Unanswered { port: port.clone(), why: error.to_string() };
    let mut frame = [0; MAX_FRAME];
    while let Some(length) = session.transmit(HostClock::start().now(), &mut frame) {
        wire.stream.write_all(frame.get(..length).unwrap_or_default()).await.map_err(fail)?;
    }
    wire.stream.flush().await.map_err(fail)
}

/// Sends a stop over `wire` every 20 ms until a pose that the holder of the port passes on shows no motion; returns the
/// state in that pose, or `None` where the holder passes no poses on.
///
/// # Errors
/// [`OpenError`] where it cannot be sent.
pub async fn stop_beside(port: &Port, mut wire: OpenWire) -> Result<Option<ControllerState>, OpenError> {
    let mut follower = Follower::attach(port).await;
    for sent in 1..=MOST {
        send_stop(port, &mut wire).await?;
        let state = timeout(APART, next_state(&mut follower)).await.ok();
        // A pose may have been on its way when the first stop left.
        if sent > 1 && state.is_some_and(|state| !is_driven(state)) {
            return Ok(state);
        }
        if state.is_none() && sent >= BLIND {
            break;
        }
    }
    Ok(None)
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
