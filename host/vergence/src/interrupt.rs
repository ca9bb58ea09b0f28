//! Requests to end this program: Ctrl-C at a terminal, or SIGTERM from a service manager or a script.

use std::future::pending;

use tokio::signal::ctrl_c;
use tokio::signal::unix::{SignalKind, signal};
use vergence_board::Board;

use crate::failure::Failure;

/// Completes when the program is asked to end. The caller must then tidy up: stop the stages, finish files.
pub async fn interrupted() {
    let terminated = async {
        match signal(SignalKind::terminate()) {
            Ok(mut signals) => _ = signals.recv().await,
            // Without a handler the signal ends the program at once, and the board's lease with it.
            Err(_) => pending().await,
        }
    };
    tokio::select! {
        _ = ctrl_c() => {}
        () = terminated => {}
    }
}

/// Runs a long computation on a thread of its own, so that a request to end is heard meanwhile. Dropping the future abandons
/// the computation: the program ends without waiting for it.
///
/// # Errors
/// Those of `work`; a computation that panicked.
pub async fn on_own_thread<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> Result<T, Failure> {
    let worked = tokio::task::spawn_blocking(work).await;
    worked.unwrap_or_else(|error| Err(Failure::device(format!("the computation failed: {error}"))))
}

/// Arms `board`, does `work`, and disarms. An interruption ends `work`: the stages brake, and the board is disarmed.
///
/// # Errors
/// Those of the board and of `work`; an interruption.
pub async fn armed<T>(
    board: &mut Board,
    work: impl AsyncFnOnce(&mut Board) -> Result<T, Failure>,
) -> Result<T, Failure> {
    board.armed(interrupted(), work).await
}
