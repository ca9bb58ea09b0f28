//! What is remembered through a reset, what the chip says of itself, and how the application dies.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use vergence_image::{Death, DeathKind, Survivor};
use vergence_nucleo_common::death;
use vergence_nucleo_common::memory::{remember, survivor};
use vergence_protocol::ResetCause;
use vergence_protocol::management::RebootTo;

#[allow(unsafe_code, reason = "a note that only the linker knows")]
unsafe extern "C" {
    /// The ELF note with the build id: sizes of name and id, type, name "GNU", id.
    static __build_id: [u32; 6];
}

/// This start was good: earlier failures no longer count.
pub fn declare_healthy() {
    remember(&Survivor { failed_starts: 0, ..survivor() });
}

/// The host wants another start: earlier failures no longer count.
pub fn prepare_reboot(to: RebootTo) {
    remember(&Survivor { failed_starts: 0, recovery_wanted: to == RebootTo::Recovery, ..survivor() });
}

/// Why the chip started, from the flags of its reset controller, which it clears for the next time.
pub fn reset_cause() -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // Every reset pulls the pin too, so the pin comes last; a brown-out is a power-on.
    if flags.iwdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        ResetCause::PowerOn
    } else {
        ResetCause::Pin
    }
}

/// The first eight bytes of the build id.
#[allow(unsafe_code, reason = "a note that only the linker knows")]
pub fn build_id() -> u64 {
    // SAFETY: build-id.x puts the note there, aligned to words, and nothing writes flash at this place.
    let note = unsafe { &__build_id };
    // As a person reads it: the first hexadecimal digits of the id.
    u64::from(note[4].swap_bytes()) << 32 | u64::from(note[5].swap_bytes())
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    die(death::here(DeathKind::Panic))
}

#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it never returns, and shares nothing but the survivor, which nobody else can write any more.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(death::of_fault(frame))
}

/// Nothing goes on: after three such starts the boot loader waits for another image.
pub fn give_up(reason: DeathKind) -> ! {
    die(death::here(reason))
}

/// Drivers off, note the cause, start again.
fn die(death: Death) -> ! {
    crate::board::cut_drivers();
    remember(&Survivor { death: Some(death), ..survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
