//! The serial link: two tasks that move bytes between the wire and the node.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_stm32::mode::Async;
use embassy_stm32::usart::{RingBufferedUartRx, UartTx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_time::{Duration, with_timeout};
use vergence_protocol::MAX_FRAME;

use crate::control;

/// What the line hears while no interrupt can be served must fit: 22 ms of a page's erasure at 2 Mbaud, twice.
pub const RING: usize = 8 * 1024;
/// A line that never falls idle is read this often.
const LOOK: Duration = Duration::from_millis(5);
/// On a silent one there is nothing to read, but the watchdog wants to see that somebody waits.
const SILENCE: Duration = Duration::from_millis(40);

/// Bytes for the node.
pub static RECEIVED: Pipe<CriticalSectionRawMutex, 512> = Pipe::new();
/// Bytes for the line.
pub static TO_SEND: Pipe<CriticalSectionRawMutex, MAX_FRAME> = Pipe::new();
/// How often the receiver has come round: the watchdog's witness.
pub static ROUNDS: AtomicU32 = AtomicU32::new(0);

/// Whether the chip is to start again once all is sent.
pub static REBOOT: AtomicBool = AtomicBool::new(false);

/// Hands a frame to [`transmit`]. The pipe must be empty, so that it fits.
pub fn queue(frame: &[u8]) {
    let mut rest = frame;
    // The pipe takes no more at once than up to its end.
    while let Ok(taken) = TO_SEND.try_write(rest)
        && taken > 0
    {
        rest = &rest[taken..];
    }
}

/// Brings bytes in. A line error loses bytes; the frame's zeros and checksum say where it goes on.
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
                control::ring();
            }
        }
    }
}

/// Takes bytes out.
#[embassy_executor::task]
pub async fn transmit(mut line: UartTx<'static, Async>) {
    let mut bytes = [0; MAX_FRAME];
    loop {
        let count = TO_SEND.read(&mut bytes).await;
        // The next frame may be chosen now: it waits while this one is on the wire.
        control::ring();
        let _ = line.write(&bytes[..count]).await;
        if REBOOT.load(Ordering::Relaxed) && TO_SEND.is_empty() {
            // The last byte is still in the shift register.
            let _ = line.flush().await;
            cortex_m::peripheral::SCB::sys_reset();
        }
    }
}
