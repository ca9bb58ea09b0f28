//! The independent watchdog, which is fed only while tick, executor and link all go on.

use core::sync::atomic::Ordering;

use embassy_stm32::Peri;
use embassy_stm32::gpio::Output;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};

use crate::{control, link, memory};

/// Longest time that one of the three may stand still, in microseconds. It covers the longest work that the node does
/// without a break while nothing moves: erasing a page of flash, checking a signature.
const PATIENCE_US: u32 = 500_000;
/// Time between two feedings.
const ROUND: Duration = Duration::from_millis(50);
/// After this many feedings a start counts as good.
const HEALTHY: u32 = 40;

/// Starts the watchdog; from now on it must be fed.
pub fn start(watchdog: Peri<'static, IWDG>) -> IndependentWatchdog<'static, IWDG> {
    let mut watchdog = IndependentWatchdog::new(watchdog, PATIENCE_US);
    watchdog.unleash();
    watchdog
}

/// Feeds the watchdog while ticks and rounds of the link go on. That this task runs shows that the executor does.
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
