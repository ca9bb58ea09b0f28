//! How this program begins and ends: the cause of the reset, the start of the application, and death.

use core::panic::PanicInfo;

use cortex_m::Peripherals;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use vergence_image::{Death, DeathKind, Survivor, layout};
use vergence_nucleo_common::memory::{remember, survivor};
use vergence_nucleo_common::{clocks, death};

/// Whether the watchdog or a program made this reset. The flags are left for the application.
pub fn was_failure() -> bool {
    let flags = pac::RCC.csr().read();
    flags.iwdgrstf() || flags.wwdgrstf() || flags.sftrstf()
}

/// Starts the application as a reset would, by its vector table.
#[allow(unsafe_code, reason = "the jump into another program")]
pub fn start_application() -> ! {
    cortex_m::interrupt::disable();
    clocks::slow_down();
    let table = layout::FLASH_BASE + layout::IMAGE.start;
    // SAFETY: this program ends here, and the image was checked: its first words are a stack pointer and an entry.
    unsafe {
        let mut core = Peripherals::steal();
        hush(&mut core);
        core.SCB.vtor.write(table);
        cortex_m::interrupt::enable();
        cortex_m::asm::bootload(table as *const u32)
    }
}

/// Masks and clears all interrupts, so that none of this program reaches the next.
fn hush(core: &mut Peripherals) {
    for block in 0..core.NVIC.icer.len() {
        // SAFETY: masking and forgetting interrupts breaks nothing of a program that ends here.
        #[allow(unsafe_code, reason = "the interrupt controller")]
        unsafe {
            core.NVIC.icer[block].write(u32::MAX);
            core.NVIC.icpr[block].write(u32::MAX);
        }
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    die(death::here(DeathKind::Panic))
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it never returns, and no other code runs any more.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(death::of_fault(frame))
}

fn die(death: Death) -> ! {
    remember(&Survivor { death: Some(death), ..survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
