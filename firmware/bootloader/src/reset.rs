//! Why this start came, and how this program dies.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use vergence_image::{Death, DeathKind, Survivor};
use vergence_nucleo_common::death;
use vergence_nucleo_common::memory::{remember, survivor};

/// Whether the watchdog or the program itself made this reset. The flags stay for the application.
pub fn fell_by_itself() -> bool {
    let flags = pac::RCC.csr().read();
    flags.iwdgrstf() || flags.wwdgrstf() || flags.sftrstf()
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    die(death::here(DeathKind::Panic))
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it never returns, and nothing else runs any more.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(death::of_fault(frame))
}

fn die(death: Death) -> ! {
    remember(&Survivor { death: Some(death), ..survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
