//! The memory kept through a reset, and the cause of the last one.

use embassy_stm32::pac;
use vergence_image::Survivor;
use vergence_nucleo_common::memory::{remember, survivor};
use vergence_protocol::ResetCause;
use vergence_protocol::management::RebootTo;

/// Forgets earlier failed starts: this one was good.
pub fn declare_healthy() {
    remember(&Survivor { failed_starts: 0, ..survivor() });
}

/// Forgets earlier failed starts and notes which program to start: the host wants a reboot.
pub fn prepare_reboot(to: RebootTo) {
    remember(&Survivor { failed_starts: 0, recovery_wanted: to == RebootTo::Recovery, ..survivor() });
}

/// Whether this start is to leave the saved settings aside; the next one is not.
pub fn take_defaults_wanted() -> bool {
    let before = survivor();
    remember(&Survivor { defaults_wanted: false, ..before });
    before.defaults_wanted
}

/// Cause of the last reset, from the flags of the reset controller; clears them for the next time.
pub fn reset_cause() -> ResetCause {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // Every reset pulls the reset pin low, so the pin comes last. A brown-out counts as power-on.
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
