//! The boot loader: finishes or undoes a swap of images, checks the image, and starts it. An application that failed three
//! times in a row is not started again: a serial recovery waits for another image.
//!
//! ```text
//! power cut at any point --> the swap is resumed (embassy-boot)
//! image on trial, not confirmed --> swapped back
//! seal broken, other hardware, wrong digest, wrong signature --> swapped back if on trial, else recovery
//! three starts that ended in a watchdog bite, a panic or a fault --> recovery
//! blue button held at the start --> recovery; the application then starts without the saved settings
//! ```

#![no_std]
#![no_main]

mod recovery;
mod reset;

use cortex_m_rt::entry;
use embassy_boot_stm32::State;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::wdg::IndependentWatchdog;
use vergence_image::layout::{ACTIVE, IMAGE};
use vergence_image::notes::oldest_of;
use vergence_image::{Seal, Survivor};
use vergence_nucleo_common::clocks::{self, Source};
use vergence_nucleo_common::{FedFlash, Services, SwapState, feed_watchdog, memory, trusted_key};

use crate::recovery::Line;

/// Time-out of the watchdog in microseconds: for an application until it sets the watchdog itself, and for this program
/// between two feedings.
const PATIENCE_US: u32 = 2_000_000;
/// Number of failed starts in a row after which the application is not started.
const ATTEMPTS: u32 = 3;

#[entry]
fn main() -> ! {
    // The oscillator inside the chip, so that a board with a dead crystal can still be reached.
    let p = clocks::start(Source::Inside);
    IndependentWatchdog::new(p.IWDG, PATIENCE_US).unleash();

    // The blue button pulls the line up (ST's board support for the STM32G4xx_Nucleo: pull-down, rising edge).
    let wants_recovery = Input::new(p.PC13, Pull::Down).is_high();
    let before = memory::survivor();
    // A press of the reset button is no failure; resets by the watchdog and by a program are.
    let failed_starts = if reset::was_failure() { before.failed_starts } else { 0 };
    let starts = before.starts.wrapping_add(1);
    let mut survivor = Survivor { failed_starts, starts, ..before };

    let services = Services::of_recovery(&p.FLASH);
    let state = SwapState::new(FedFlash::new(p.FLASH)).carry_out();
    feed_watchdog();
    let seal = Seal::check(memory::region(ACTIVE), trusted_key()).ok();
    let sound = seal.is_some();
    if !sound && state == State::Swap {
        // A swap was just made or undone. If it was made, the next start undoes it.
        memory::remember(&survivor);
        cortex_m::peripheral::SCB::sys_reset();
    }
    if sound && !wants_recovery && !survivor.recovery_wanted && failed_starts < ATTEMPTS {
        survivor.failed_starts += 1;
        memory::remember(&survivor);
        reset::start_application();
    }
    let defaults_wanted = survivor.defaults_wanted || wants_recovery;
    memory::remember(&Survivor { failed_starts: 0, recovery_wanted: false, defaults_wanted, ..survivor });
    // The oldest version that the installed application accepts, which its signature covers.
    let installed = seal.and_then(|seal| memory::region(IMAGE).get(..seal.header.length as usize));
    let oldest = installed.and_then(oldest_of).unwrap_or_default();
    let line = Line { port: p.LPUART1, tx: p.PA2, rx: p.PA3, tx_dma: p.DMA1_CH2, rx_dma: p.DMA1_CH1 };
    recovery::serve(line, services, oldest)
}
