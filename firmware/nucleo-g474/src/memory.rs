//! The memory kept through a reset, the cause of the last one, and the place of the node.

use core::mem::MaybeUninit;
use core::ptr::addr_of_mut;

use embassy_stm32::pac;
use vergence_control::Node;
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

/// Keeps the node for good, in a memory of its own, which nothing clears at a start. To be called once.
#[allow(unsafe_code, reason = "a static that is written before it is read")]
pub fn keep_node(node: Node) -> &'static mut Node {
    #[unsafe(link_section = ".ccm")]
    static mut PLACE: MaybeUninit<Node> = MaybeUninit::uninit();
    // SAFETY: only `main` calls this, once in a start; nothing else can name the place, so the reference is the only one.
    let place = unsafe { &mut *addr_of_mut!(PLACE) };
    place.write(node)
}
