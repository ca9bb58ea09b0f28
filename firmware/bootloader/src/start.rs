//! The jump.

use cortex_m::Peripherals;
use vergence_image::layout;
use vergence_nucleo_common::clocks;

/// Starts the application, as a reset would: its vector table says where.
#[allow(unsafe_code, reason = "the jump into another program")]
pub fn application() -> ! {
    cortex_m::interrupt::disable();
    clocks::slow_down();
    let table = layout::FLASH_BASE + layout::ACTIVE.start;
    // SAFETY: this program ends here, and the image was judged: its first words are a stack pointer and an entry.
    unsafe {
        let mut core = Peripherals::steal();
        hush(&mut core);
        core.SCB.vtor.write(table);
        cortex_m::interrupt::enable();
        cortex_m::asm::bootload(table as *const u32)
    }
}

/// No interrupt of this program may reach the next.
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
