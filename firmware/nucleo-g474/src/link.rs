//! The serial link: two tasks that move bytes between the wire and the node.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;
use embassy_time::Duration;
use vergence_protocol::MAX_FRAME;

use crate::exchange::{self, BAUD, RECEIVED, TO_SEND};
use crate::receiver::Receiver;

/// Longest wait for a read to end while bytes arrive without a pause.
const LOOK: Duration = Duration::from_millis(5);
/// Longest wait on a silent line: the watchdog must see [`ROUNDS`] grow.
const SILENCE: Duration = Duration::from_millis(40);

/// Counts the rounds of [`receive`]: shows the watchdog that the task runs.
pub static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Moves bytes from the line to the node. A line error loses bytes; the receiver finds the next frame by its zero and
/// checks it by its checksum.
#[embassy_executor::task]
pub async fn receive(mut line: Receiver) {
    let mut bytes = [0; 256];
    let mut patience = SILENCE;
    loop {
        ROUNDS.fetch_add(1, Ordering::Relaxed);
        let count = line.read(&mut bytes, patience).await;
        patience = if count > 0 { LOOK } else { SILENCE };
        let mut rest = &bytes[..count];
        while !rest.is_empty() {
            let taken = RECEIVED.write(rest).await;
            rest = &rest[taken..];
            exchange::ring();
        }
        // Requests may come faster than they are done: the answers to those before must not wait for the last.
        yield_now().await;
    }
}

/// Moves bytes from the node to the line, changes its speed, and restarts the chip when that is due.
#[embassy_executor::task]
pub async fn transmit(mut line: UartTx<'static, Async>) {
    let mut bytes = [0; MAX_FRAME];
    loop {
        // The speed first: what waits to be sent was queued after it.
        let count = match select(BAUD.wait(), TO_SEND.read(&mut bytes)).await {
            Either::First(baud) => {
                // The last byte is still in the shift register.
                let _ = line.flush().await;
                // A speed that the port cannot make is one at which nobody is heard: the node returns to the one before.
                let _ = line.set_baudrate(baud);
                continue;
            }
            Either::Second(count) => count,
        };
        // The node may choose the next frame now: it waits while this one is on the wire.
        exchange::ring();
        let _ = line.write(&bytes[..count]).await;
        if exchange::reboot_is_due() {
            // The last byte is still in the shift register.
            let _ = line.flush().await;
            cortex_m::peripheral::SCB::sys_reset();
        }
    }
}
