//! Why this start came, and how this program dies.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use vergence_image::{Death, Survivor};
use vergence_nucleo_common::memory::{remember, survivor};

/// Whether the watchdog or the program itself made this reset. The flags stay for the application.
pub fn fell_by_itself() -> bool {
    let flags = pac::RCC.csr().read();
    flags.iwdgrstf() || flags.wwdgrstf() || flags.sftrstf()
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    let (file, line) = info.location().map_or(("", 0), |place| (place.file(), place.line()));
    die(Death::panic(file, line))
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it never returns, and nothing else runs any more.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(Death::hard_fault(frame.pc(), frame.lr()))
}

fn die(death: Death) -> ! {
    remember(&Survivor { death: Some(death), ..survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
