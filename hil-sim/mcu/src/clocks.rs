//! Frequencies of the clock tree (RM0440 §7.2), and the limits of the silicon.

use crate::peripheral::Reply;
use crate::time::{Picoseconds, TimeBase};
use crate::unit::UartId;

/// The crystal of the NUCLEO-G474RE board (UM2505 §6.8.1).
pub(crate) const HSE_HZ: u32 = 24_000_000;
/// The internal high-speed oscillator.
pub(crate) const HSI16_HZ: u32 = 16_000_000;
/// The internal oscillator for USB and random numbers.
pub(crate) const HSI48_HZ: u32 = 48_000_000;
/// The watch crystal.
pub(crate) const LSE_HZ: u32 = 32_768;
/// The internal slow oscillator that drives the independent watchdog.
pub(crate) const LSI_HZ: u32 = 32_000;

/// Frequencies in hertz; zero where a clock stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockTree {
    /// System clock.
    pub sysclk: u32,
    /// Core, AHB and memory clock.
    pub hclk: u32,
    /// Clocks of the two peripheral buses.
    pub pclk: [u32; 2],
    /// Core cycles to one timer clock, for the timers of each bus.
    pub(crate) timer_divider: [u32; 2],
    /// Clocks of the serial ports.
    pub(crate) uart: [u32; UartId::COUNT],
    /// The 48 MHz clock of the random number generator.
    pub(crate) clk48: u32,
    /// Whether the PLL gives the system clock.
    pub(crate) from_pll: bool,
}

impl ClockTree {
    /// Whether the core runs faster than the system clock may step, with its whole speed.
    fn is_beyond_one_step(&self) -> bool {
        self.from_pll && self.hclk > ONE_STEP_HZ && self.hclk == self.sysclk
    }
}

/// Highest core clock to which, or from which, the system clock may step at once (RM0440 §7.2.7).
const ONE_STEP_HZ: u32 = 80_000_000;
/// Shortest time in the state between, with AHB divided by two.
const BETWEEN: Picoseconds = Picoseconds::microseconds(1);

/// Refuses a step between the PLL and another source with a core clock above 80 MHz: AHB must be divided for a microsecond
/// (RM0440 §7.2.7; §6.1.5 asks for the same on the way to the boost mode). `lasted` is how long the core clock was that of
/// `before`.
pub(crate) fn check_step(before: &ClockTree, after: &ClockTree, lasted: Picoseconds) -> Reply<()> {
    let fast = if after.from_pll { after } else { before };
    if before.from_pll != after.from_pll && fast.is_beyond_one_step() {
        let words = format!(
            "the core clock steps from {} to {} Hz at once: AHB must be divided by two for 1 us, where the system clock is \
             switched to or from the PLL above 80 MHz (RM0440 7.2.7)",
            before.hclk, after.hclk
        );
        return Err(crate::peripheral::Refused(words));
    }
    let is_between = before.from_pll && before.sysclk > ONE_STEP_HZ && !before.is_beyond_one_step();
    let leaves = after.is_beyond_one_step() || !after.from_pll;
    if is_between && leaves && lasted < BETWEEN {
        let words = format!("AHB was divided for {} ns, which must be at least 1 us (RM0440 7.2.7)", lasted.0 / 1_000);
        return Err(crate::peripheral::Refused(words));
    }
    Ok(())
}

/// The tree, and how its core clock counts time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Clocks {
    pub base: TimeBase,
    pub tree: ClockTree,
}

/// The core supply, as PWR_CR1.VOS and PWR_CR5.R1MODE choose it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VoltageRange {
    Boost,
    Normal,
    Low,
}

/// Refuses a core clock that the supply or the flash's wait states do not allow (RM0440 §3.3.3).
pub(crate) fn check_core_clock(hclk: u32, range: VoltageRange, wait_states: u32) -> Reply<()> {
    let (range_name, each_state, highest) = match range {
        VoltageRange::Boost => ("range 1 boost", 34_000_000, 170_000_000),
        VoltageRange::Normal => ("range 1", 30_000_000, 150_000_000),
        VoltageRange::Low => ("range 2", 12_000_000, 26_000_000),
    };
    if hclk > highest {
        return Err(crate::peripheral::Refused(format!("a core clock of {hclk} Hz is too fast for {range_name}")));
    }
    let needed = hclk.div_ceil(each_state).saturating_sub(1);
    if wait_states < needed {
        let words =
            format!("a core clock of {hclk} Hz in {range_name} needs {needed} flash wait states, not {wait_states}");
        return Err(crate::peripheral::Refused(words));
    }
    Ok(())
}
