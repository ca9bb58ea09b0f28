//! The serial link: two tasks that move bytes between the wire and the node.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_futures::yield_now;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{RingBufferedUartRx, UartTx};
use embassy_time::{Duration, with_timeout};
use static_cell::StaticCell;
use vergence_protocol::MAX_FRAME;

use crate::exchange::{self, RECEIVED, TO_SEND};

/// Bytes of the receive ring: nearly twice what arrives in the 22 ms of a page erasure at 2 Mbaud, when no interrupt is served.
const RING: usize = 8 * 1024;
/// Longest wait for a read to end while bytes arrive without a pause.
const LOOK: Duration = Duration::from_millis(5);
/// Longest wait on a silent line: the watchdog must see [`ROUNDS`] grow.
const SILENCE: Duration = Duration::from_millis(40);

/// Counts the rounds of [`receive`]: shows the watchdog that the task runs.
pub static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Memory for bytes that DMA has received. Call it once.
pub fn ring_buffer() -> &'static mut [u8] {
    static MEMORY: StaticCell<[u8; RING]> = StaticCell::new();
    MEMORY.init_with(|| [0; RING])
}

/// Moves bytes from the line to the node. A line error loses bytes; the receiver finds the next frame by its zero and
/// checks it by its checksum.
#[embassy_executor::task]
pub async fn receive(mut line: RingBufferedUartRx<'static>) {
    let mut bytes = [0; 256];
    let mut patience = SILENCE;
    loop {
        ROUNDS.fetch_add(1, Ordering::Relaxed);
        let read = with_timeout(patience, line.read(&mut bytes)).await;
        patience = if read.is_ok() { LOOK } else { SILENCE };
        if let Ok(Ok(count)) = read {
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
}

/// Moves bytes from the node to the line, and restarts the chip when that is due.
#[embassy_executor::task]
pub async fn transmit(mut line: UartTx<'static, Async>) {
    let mut bytes = [0; MAX_FRAME];
    loop {
        let count = TO_SEND.read(&mut bytes).await;
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
