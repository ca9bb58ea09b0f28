//! Words of flash that power-off tore while they were programmed or erased.
//!
//! Reading one raises the non-maskable interrupt, again and again until the flag is cleared (RM0440, 3.3.4). That is no
//! reason to stop: swap, settings and update know how to go on from any content.

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;
use embassy_stm32::pac::FLASH;

static TORN: AtomicBool = AtomicBool::new(false);

/// Runs `read`; `None` where it met a torn word.
pub fn guarded<R>(read: impl FnOnce() -> R) -> Option<R> {
    TORN.store(false, Ordering::SeqCst);
    let result = read();
    (!TORN.load(Ordering::SeqCst)).then_some(result)
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it clears one flag of the flash and sets one atomic.
#[exception]
unsafe fn NonMaskableInt() {
    FLASH.eccr().modify(|w| w.set_eccd(true));
    TORN.store(true, Ordering::SeqCst);
}
