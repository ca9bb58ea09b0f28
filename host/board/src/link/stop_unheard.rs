//! A stop over a port whose answers another program reads.

use std::time::Duration;

use tokio::io::AsyncWriteExt;
use vergence_protocol::{HostSession, MAX_FRAME, Request, StopKind};

use super::clock::HostClock;
use super::error::OpenError;
use super::open::{OpenWire, Port};
use super::session_id::fresh_session;

/// Number of times that the stop is sent.
const REPEATS: u32 = 3;
/// Time between two of them.
const APART: Duration = Duration::from_millis(20);

/// Sends a stop a few times over `wire`, which leads to `port`, and leaves the answers to the program that holds the port.
///
/// # Errors
/// [`OpenError`] where it cannot be sent.
pub async fn stop_unheard(port: &Port, mut wire: OpenWire) -> Result<(), OpenError> {
    let clock = HostClock::start();
    for _ in 0..REPEATS {
        let mut session = HostSession::new(fresh_session()?);
        let sent = session.send_now(Request::Stop { kind: StopKind::Decelerate });
        sent.map_err(|error| OpenError::NoStop(error.to_string()))?;
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = session.transmit(clock.now(), &mut frame) {
            let bytes = frame.get(..length).unwrap_or_default();
            let fail = |error: std::io::Error| OpenError::Unanswered { port: port.clone(), why: error.to_string() };
            wire.stream.write_all(bytes).await.map_err(fail)?;
        }
        tokio::time::sleep(APART).await;
    }
    Ok(())
}
