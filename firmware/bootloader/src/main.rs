//! The boot loader: finishes a swap of images or undoes one on trial, judges the image, and starts it. What fails three
//! times in a row is not started again: a serial recovery waits for another image.
//!
//! ```text
//! power cut at any point --> the swap goes on where it was (embassy-boot)
//! image on trial, not confirmed --> swapped back
//! seal broken, other hardware, wrong digest, wrong signature --> swapped back if on trial, else recovery
//! three starts that ended in a watchdog bite, a panic or a fault --> recovery
//! ```

#![no_std]
#![no_main]

mod recovery;
mod reset;
mod start;

use cortex_m_rt::entry;
use embassy_boot_stm32::State;
use embassy_stm32::wdg::IndependentWatchdog;
use vergence_image::layout::ACTIVE;
use vergence_image::{DEVELOPMENT_KEY, Seal, Survivor};
use vergence_nucleo_common::clocks::{self, Source};
use vergence_nucleo_common::{FedFlash, Services, SwapState, feed_watchdog, memory};

use crate::recovery::Line;

/// How long an application may take until it sets the watchdog itself, and anything here between two feedings.
const PATIENCE_US: u32 = 2_000_000;
/// After so many failed starts nothing is started.
const ATTEMPTS: u32 = 3;

#[entry]
fn main() -> ! {
    // So that a board with a dead crystal can still be reached.
    let p = clocks::start(Source::Inside);
    IndependentWatchdog::new(p.IWDG, PATIENCE_US).unleash();

    let before = memory::survivor();
    // A person's button is no failure; a bite of the watchdog and a reset by the program itself are.
    let failed_starts = if reset::fell_by_itself() { before.failed_starts } else { 0 };
    let starts = before.starts.wrapping_add(1);
    let mut survivor = Survivor { failed_starts, starts, ..before };

    let services = Services::of_recovery(&p.FLASH);
    let state = SwapState::new(FedFlash::new(p.FLASH)).carry_out();
    feed_watchdog();
    let sound = Seal::check(memory::region(ACTIVE), &DEVELOPMENT_KEY).is_ok();
    if !sound && state == State::Swap {
        // The swap was just made or just undone. In the first case the next start undoes it.
        memory::remember(&survivor);
        cortex_m::peripheral::SCB::sys_reset();
    }
    if sound && !survivor.recovery_wanted && failed_starts < ATTEMPTS {
        survivor.failed_starts += 1;
        memory::remember(&survivor);
        start::application();
    }
    memory::remember(&Survivor { failed_starts: 0, recovery_wanted: false, ..survivor });
    let line = Line { port: p.LPUART1, tx: p.PA2, rx: p.PA3, tx_dma: p.DMA1_CH2, rx_dma: p.DMA1_CH1 };
    recovery::serve(line, services)
}
