//! What pages see and may do while the link to the board is gone.

use std::pin::pin;
use std::time::Duration;

use tokio::time::{Instant, interval};

use crate::driver::Driver;
use crate::panel::Panel;
use crate::status::report_lost;

/// Time between two messages on how long the link has been gone.
const PACE: Duration = Duration::from_millis(500);

/// Waits for `reached`. Meanwhile pages are told how long the link has been gone, what waits is taken back, and orders are refused.
pub async fn without_link<T>(panel: &Panel, driver: &mut Driver, reached: impl Future<Output = T>) -> T {
    panel.hub.halt("the link to the board ended; the board brakes by itself");
    let (mut reached, mut told, since) = (pin!(reached), interval(PACE), Instant::now());
    loop {
        tokio::select! {
            reached = &mut reached => {
                panel.note("the search for the board is over: nothing moves until a page orders it");
                return reached;
            }
            () = driver.refuse() => {}
            _ = told.tick() => report_lost(&panel.hub, since.elapsed()),
        }
    }
}
