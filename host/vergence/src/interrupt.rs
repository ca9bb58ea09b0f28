//! When somebody wants this program to end: Ctrl-C at a terminal, or SIGTERM from a service manager or a script.

use std::future::pending;

use tokio::signal::ctrl_c;
use tokio::signal::unix::{SignalKind, signal};

/// Returns once that is so. Whoever waits for it must tidy up then: stages are told to stop, files are written.
pub async fn interrupted() {
    let terminated = async {
        match signal(SignalKind::terminate()) {
            Ok(mut signals) => _ = signals.recv().await,
            // The program then ends at the signal without further ado, and the board's lease with it.
            Err(_) => pending().await,
        }
    };
    tokio::select! {
        _ = ctrl_c() => {}
        () = terminated => {}
    }
}
