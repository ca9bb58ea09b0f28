//! How the application dies: drivers off, cause noted, restart.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use vergence_image::{Death, DeathKind, Survivor};
use vergence_nucleo_common::death;
use vergence_nucleo_common::memory::{remember, survivor};

use crate::board::cut_drivers;

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    die(death::here(DeathKind::Panic))
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it never returns, and shares nothing but the survivor, which no other code can write any more.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(death::of_fault(frame))
}

/// Ends a start that cannot go on. After three such starts the boot loader waits for another image.
pub fn give_up(reason: DeathKind) -> ! {
    die(death::here(reason))
}

/// Switches the drivers off, notes the cause and restarts.
fn die(death: Death) -> ! {
    cut_drivers();
    remember(&Survivor { death: Some(death), ..survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
