//! What the link's tasks and the node in its interrupt hand to each other: bytes in, bytes out, another speed of the line,
//! a wish to restart, and a doorbell. Both use this file and neither knows the other.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::interrupt;
use embassy_stm32::interrupt::InterruptExt;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::signal::Signal;
use vergence_protocol::MAX_FRAME;

/// Bytes from the line for the node.
pub static RECEIVED: Pipe<CriticalSectionRawMutex, 512> = Pipe::new();
/// Bytes from the node for the line: one frame at most.
pub static TO_SEND: Pipe<CriticalSectionRawMutex, MAX_FRAME> = Pipe::new();
/// The speed that the line gets when all bytes before are sent, in baud.
pub static BAUD: Signal<CriticalSectionRawMutex, u32> = Signal::new();

/// Whether the chip is to restart once all bytes are sent.
static REBOOT: AtomicBool = AtomicBool::new(false);

/// Makes the node run soon, apart from its ticks: bytes came, or the line takes another frame.
pub fn ring() {
    interrupt::TIM7_DAC.pend();
}

/// Puts a frame into [`TO_SEND`], which must be empty, so that the frame fits.
pub fn queue(frame: &[u8]) {
    let mut rest = frame;
    // The pipe takes bytes only up to the end of its ring at once.
    while let Ok(taken) = TO_SEND.try_write(rest)
        && taken > 0
    {
        rest = &rest[taken..];
    }
}

/// Asks the link to restart the chip once all bytes are sent.
pub fn request_reboot() {
    REBOOT.store(true, Ordering::Relaxed);
}

/// Whether the chip is to restart now: it was asked for, and no byte waits.
pub fn reboot_is_due() -> bool {
    REBOOT.load(Ordering::Relaxed) && TO_SEND.is_empty()
}
