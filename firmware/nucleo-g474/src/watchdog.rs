//! The independent watchdog, fed only while tick, executor and link all go on.

use core::sync::atomic::Ordering;

use embassy_stm32::gpio::Output;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};

use crate::memory;
use crate::{control, link};

/// How long the three may stand still. It must cover what the node does at a stretch while nothing moves: erasing a page
/// of flash, checking a signature.
pub const PATIENCE_US: u32 = 500_000;
const ROUND: Duration = Duration::from_millis(50);
/// So many rounds without a bite prove a start good.
const HEALTHY: u32 = 40;

/// The executor's witness is that this task runs.
#[embassy_executor::task]
pub async fn watch(mut watchdog: IndependentWatchdog<'static, IWDG>, mut led: Output<'static>) {
    let mut every = Ticker::every(ROUND);
    let mut seen = (0, 0);
    let mut rounds = 0_u32;
    loop {
        every.next().await;
        let present = (control::TICKS.load(Ordering::Relaxed), link::ROUNDS.load(Ordering::Relaxed));
        if present.0 == seen.0 || present.1 == seen.1 {
            continue;
        }
        seen = present;
        watchdog.pet();
        rounds = rounds.wrapping_add(1);
        if rounds == HEALTHY {
            memory::declare_healthy();
        }
        if rounds.is_multiple_of(10) {
            led.toggle();
        }
    }
}
