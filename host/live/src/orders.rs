//! Orders that a person types while the live loop runs.

use std::io::BufRead;

use tokio::sync::mpsc::{Receiver, channel};

/// The line that orders the axes to be homed.
pub const HOME: &str = "home";

/// Listens for lines `home` from now on; other lines are no orders. Reading blocks, so that it has a thread of its own, which ends with
/// the input or with the program.
#[must_use]
pub fn homing_orders(input: impl BufRead + Send + 'static) -> Receiver<()> {
    let (sender, orders) = channel(1);
    std::thread::spawn(move || {
        for line in input.lines().map_while(Result::ok) {
            // One order that waits is enough.
            if line.trim() == HOME && sender.try_send(()).is_err() && sender.is_closed() {
                return;
            }
        }
    });
    orders
}
