//! IWDG: the independent watchdog (RM0440 §42).

use vergence_cpu::{Cycle, NEVER};

use crate::clocks::{Clocks, LSI_HZ};
use crate::peripheral::{Moment, Peripheral, Registers, Reply};
use crate::time::Picoseconds;

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const SR: u32 = 0x0C;
const WINR: u32 = 0x10;

/// A new value reaches the watchdog's own clock domain within this many of its clocks (§42.4.4).
const UPDATE_CLOCKS: u64 = 5;

/// The watchdog.
#[derive(Clone, Debug)]
pub(crate) struct Iwdg {
    prescaler: u32,
    reload: u32,
    window: u32,
    unlocked: bool,
    /// When the counter was last loaded; `None` before it was started.
    loaded: Option<Picoseconds>,
    /// When values just written take effect: prescaler, reload, window.
    updated_at: [Option<Picoseconds>; 3],
    /// Whether the watchdog has reset the chip.
    pub bites: bool,
    /// Whether the watchdog has just been started.
    pub starts: bool,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self {
            prescaler: 0,
            reload: 0xFFF,
            window: 0xFFF,
            unlocked: false,
            loaded: None,
            updated_at: [None; 3],
            bites: false,
            starts: false,
        }
    }
}

impl Iwdg {
    fn counts(&self, counts: u32) -> Picoseconds {
        let divider = 4u64 << self.prescaler.min(6);
        Picoseconds::periods(u64::from(counts) * divider, LSI_HZ)
    }

    fn bites_at(&self) -> Option<Picoseconds> {
        self.loaded.map(|loaded| loaded + self.counts(self.reload + 1))
    }

    /// Reloading while the counter is above the window resets the chip (§42.3.3).
    fn feed(&mut self, now: Picoseconds) {
        let Some(loaded) = self.loaded else { return };
        let window_opens = loaded + self.counts(self.reload.saturating_sub(self.window));
        if self.window < self.reload && now < window_opens {
            self.bites = true;
        }
        self.loaded = Some(now);
    }

    /// Stands for a duration, from now on.
    pub fn stand(&mut self, duration: Picoseconds) {
        let later = |at: &mut Option<Picoseconds>| *at = at.map(|at| at + duration);
        later(&mut self.loaded);
        self.updated_at.iter_mut().for_each(later);
    }

    fn set(&mut self, moment: Moment, which: usize, value: u32) -> Reply<()> {
        if !self.unlocked {
            return Err("the watchdog's registers are locked".into());
        }
        if self.updated_at[which].is_some() {
            return Err("written before the last value arrived".into());
        }
        *[&mut self.prescaler, &mut self.reload, &mut self.window][which] = value;
        if self.loaded.is_some() {
            self.updated_at[which] = Some(moment.time() + Picoseconds::periods(UPDATE_CLOCKS, LSI_HZ));
        }
        Ok(())
    }
}

impl Peripheral for Iwdg {
    fn registers(&self) -> Registers {
        &[(KR, "KR"), (PR, "PR"), (RLR, "RLR"), (SR, "SR"), (WINR, "WINR")]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            PR => self.prescaler,
            RLR => self.reload,
            SR => self.updated_at.iter().enumerate().fold(0, |flags, (bit, at)| flags | u32::from(at.is_some()) << bit),
            WINR => self.window,
            _ => 0,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match (offset, value) {
            (KR, 0x5555) => self.unlocked = true,
            (KR, 0xAAAA) => {
                self.unlocked = false;
                self.feed(moment.time());
            }
            (KR, 0xCCCC) => {
                self.unlocked = false;
                self.starts = self.loaded.is_none();
                self.loaded = self.loaded.or(Some(moment.time()));
            }
            (KR, _) => self.unlocked = false,
            (PR, value) => self.set(moment, 0, value & 7)?,
            (RLR, value) => self.set(moment, 1, value & 0xFFF)?,
            (WINR, value) => {
                self.set(moment, 2, value & 0xFFF)?;
                // Writing the window loads the counter as well (§42.3.3).
                if self.loaded.is_some() {
                    self.loaded = Some(moment.time());
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        let base = &moment.clocks.base;
        for at in &mut self.updated_at {
            if at.is_some_and(|at| base.cycle_at(at) <= moment.now) {
                *at = None;
            }
        }
        if self.bites_at().is_some_and(|at| base.cycle_at(at) <= moment.now) {
            self.bites = true;
        }
    }

    fn due(&self, clocks: &Clocks) -> Cycle {
        let next = self.updated_at.iter().flatten().copied().chain(self.bites_at()).min();
        next.map_or(NEVER, |at| clocks.base.cycle_at(at))
    }
}
