//! SysTick (B3.3): a 24-bit down counter, computed from the clock when it is read.

use crate::bus::{Cycle, NEVER};

const ENABLE: u32 = 1;
const INTERRUPT: u32 = 1 << 1;
const CORE_CLOCK: u32 = 1 << 2;
const COUNTED: u32 = 1 << 16;
const COUNTER_BITS: u32 = 0x00ff_ffff;
/// The STM32G4 feeds the reference clock with an eighth of the core clock.
const REFERENCE_DIVIDER: Cycle = 8;
/// No reference for 10 ms is given: skewed, as the chip reports it.
const CALIBRATION: u32 = 0x4000_0000;

#[derive(Clone)]
pub(crate) struct SysTick {
    control: u32,
    reload: u32,
    /// The counter as it was at `since`.
    value: u32,
    since: Cycle,
    counted: bool,
}

impl SysTick {
    pub const fn new() -> Self {
        Self { control: 0, reload: 0, value: 0, since: 0, counted: false }
    }

    const fn divider(&self) -> Cycle {
        if self.control & CORE_CLOCK != 0 { 1 } else { REFERENCE_DIVIDER }
    }

    /// Ticks until the counter next reaches zero, if it ever does.
    fn ticks_to_zero(&self) -> Option<Cycle> {
        match (self.control & ENABLE != 0, self.value, self.reload) {
            (false, ..) | (_, 0, 0) => None,
            (true, 0, reload) => Some(Cycle::from(reload) + 1),
            (true, value, _) => Some(Cycle::from(value)),
        }
    }

    /// When the counter next reaches zero.
    #[inline]
    pub fn next_event(&self) -> Cycle {
        self.ticks_to_zero().map_or(NEVER, |ticks| self.since.saturating_add(ticks * self.divider()))
    }

    /// Advances the counter to `now`; returns whether the exception becomes pending.
    pub fn advance(&mut self, now: Cycle) -> bool {
        if self.control & ENABLE == 0 {
            self.since = now;
            return false;
        }
        let mut ticks = now.saturating_sub(self.since) / self.divider();
        self.since += ticks * self.divider();
        let Some(to_zero) = self.ticks_to_zero() else { return false };
        if ticks < to_zero {
            self.value = if self.value == 0 && ticks > 0 {
                // The first tick reloads.
                self.reload - (ticks as u32 - 1)
            } else {
                self.value - ticks as u32
            };
            return false;
        }
        ticks = (ticks - to_zero) % (Cycle::from(self.reload) + 1);
        self.value = if ticks == 0 { 0 } else { self.reload + 1 - ticks as u32 };
        self.counted = true;
        self.control & INTERRUPT != 0
    }

    /// Register at `offset` from 0xE000_E010. Reading the control register clears its count flag.
    pub fn read(&mut self, offset: u32) -> u32 {
        match offset {
            0 => self.control | if std::mem::take(&mut self.counted) { COUNTED } else { 0 },
            4 => self.reload,
            8 => self.value,
            _ => CALIBRATION,
        }
    }

    /// Writes a register. Call [`advance`](Self::advance) first.
    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0 => self.control = value & (ENABLE | INTERRUPT | CORE_CLOCK),
            4 => self.reload = value & COUNTER_BITS,
            8 => {
                self.value = 0;
                self.counted = false;
            }
            _ => {}
        }
    }
}
