//! What survives a reset, the application's bytes, and how this program dies.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use vergence_image::{Death, SURVIVOR_WORDS, Survivor, layout};

/// What the board remembers.
#[allow(unsafe_code, reason = "RAM outside the program's own")]
pub fn survivor() -> Survivor {
    let memory = layout::SURVIVOR.start as *const [u32; SURVIVOR_WORDS];
    // SAFETY: memory.x keeps this RAM free of variables and stack, any bits are valid words, and nothing runs beside.
    Survivor::from_words(&unsafe { memory.read_volatile() })
}

/// Makes the board remember.
#[allow(unsafe_code, reason = "RAM outside the program's own")]
pub fn remember(survivor: &Survivor) {
    let memory = layout::SURVIVOR.start as *mut [u32; SURVIVOR_WORDS];
    // SAFETY: as in `survivor`.
    unsafe { memory.write_volatile(survivor.to_words()) };
}

/// Whether the watchdog or the program itself made this reset. The flags stay for the application.
pub fn fell_by_itself() -> bool {
    let flags = pac::RCC.csr().read();
    flags.iwdgrstf() || flags.wwdgrstf() || flags.sftrstf()
}

/// The region of the application, its seal included.
#[allow(unsafe_code, reason = "flash as memory")]
pub fn active() -> &'static [u8] {
    let start = (layout::FLASH_BASE + layout::ACTIVE.start) as *const u8;
    // SAFETY: flash is there, readable, and nothing writes it any more before this program ends or starts anew.
    unsafe { core::slice::from_raw_parts(start, layout::ACTIVE.length as usize) }
}

/// A word of flash that power-off tore raises this at each read (RM0440, 3.3.4). The swap knows how to go on from any
/// content, so forget the error and go on.
#[allow(unsafe_code, reason = "what cortex-m-rt asks for")]
// SAFETY: it touches one register of the flash and shares nothing.
#[exception]
unsafe fn NonMaskableInt() {
    pac::FLASH.eccr().modify(|w| w.set_eccd(true));
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
