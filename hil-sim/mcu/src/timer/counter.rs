//! How the count runs, wraps and updates, and when that is observable (RM0440 §28.3.2 to §28.3.3).

use vergence_cpu::{Cycle, NEVER};

use super::{CEN, DIR, OPM, Timer, UDIS, UIF, URS};

/// The counter with its prescaler.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counter {
    pub count: u32,
    /// The values in use: prescaler, highest count, and wraps left before an update.
    pub prescaler: u32,
    pub reload: u32,
    pub repetitions: u32,
    /// Core cycles to one clock of the timer.
    divider: u64,
    /// When `count` took its value.
    since: Cycle,
    /// Core cycles spent at `count` before the counter was stopped; it is running where there are none.
    stopped_after: Option<u64>,
    /// Edges seen by the prescaler in external clock mode.
    edges: u32,
    pub counts_down: bool,
}

impl Counter {
    pub fn new(highest: u32) -> Self {
        Self {
            count: 0,
            prescaler: 0,
            reload: highest,
            repetitions: 0,
            divider: 1,
            since: 0,
            stopped_after: Some(0),
            edges: 0,
            counts_down: false,
        }
    }

    /// The count at which a period begins.
    fn origin(&self) -> u32 {
        if self.counts_down { self.reload } else { 0 }
    }

    /// Core cycles to one count.
    fn step(&self) -> u64 {
        self.divider * (u64::from(self.prescaler) + 1)
    }

    pub fn divider(&self) -> u64 {
        self.divider
    }

    pub fn set_divider(&mut self, now: Cycle, divider: u32) {
        self.divider = u64::from(divider);
        if self.stopped_after.is_none() {
            self.since = now;
        }
    }

    /// Starts or stops. Counting begins one timer clock after the enable bit (§28.3.2).
    fn run(&mut self, now: Cycle, on: bool) {
        match (self.stopped_after, on) {
            (Some(spent), true) => {
                self.since = (now + self.divider).saturating_sub(spent);
                self.stopped_after = None;
            }
            (None, false) => self.stopped_after = Some(now.saturating_sub(self.since)),
            _ => {}
        }
    }

    fn restart(&mut self, now: Cycle) {
        self.count = self.origin();
        self.edges = 0;
        match &mut self.stopped_after {
            Some(spent) => *spent = 0,
            None => self.since = now,
        }
    }

    /// Whole counts between `since` and `now`.
    fn counts_until(&self, now: Cycle) -> u64 {
        if self.stopped_after.is_some() { 0 } else { now.saturating_sub(self.since) / self.step() }
    }

    /// Counts from here until a new period begins, and whether that is an overflow: counting up, a count beyond the
    /// reload value first runs through all its bits.
    fn counts_to_wrap(&self, highest: u32) -> (u64, bool) {
        if self.counts_down {
            (u64::from(self.count) + 1, true)
        } else if self.count <= self.reload {
            (u64::from(self.reload - self.count) + 1, true)
        } else {
            (u64::from(highest - self.count) + 1, false)
        }
    }
}

impl Timer {
    /// Advances the count to `now`.
    pub(super) fn run(&mut self, now: Cycle) {
        loop {
            let counts = self.counter.counts_until(now);
            // With a reload value of zero the counter is blocked (§28.4.13).
            if counts == 0 || self.counter.reload == 0 {
                return;
            }
            let (to_wrap, overflows) = self.counter.counts_to_wrap(self.variant.highest);
            if counts < to_wrap {
                self.count_on(counts);
                return;
            }
            self.count_on(to_wrap - 1);
            self.wrap(overflows);
            self.skip_periods(now);
        }
    }

    /// Advances the count without wrapping.
    fn count_on(&mut self, counts: u64) {
        if counts == 0 {
            return;
        }
        let from = u64::from(self.counter.count);
        self.counter.since += counts * self.counter.step();
        if self.counter.counts_down {
            self.counter.count = (from - counts) as u32;
            self.matches_in(from - counts, from - 1);
        } else {
            self.counter.count = (from + counts) as u32;
            self.matches_in(from + 1, from + counts);
        }
    }

    /// Ends a period after its last count.
    fn wrap(&mut self, overflows: bool) {
        self.counter.since += self.counter.step();
        if overflows {
            self.matches_beyond_reload();
            self.overflow();
        }
        self.counter.count = self.counter.origin();
        self.outputs_changed |= self.watched != 0;
        self.match_here();
    }

    fn match_here(&mut self) {
        let here = u64::from(self.counter.count);
        self.matches_in(here, here);
    }

    /// Takes an overflow, which is an update once the repetitions are used up.
    pub(super) fn overflow(&mut self) {
        if self.counter.repetitions > 0 {
            self.counter.repetitions -= 1;
            return;
        }
        if self.cr1 & UDIS == 0 {
            self.update(true);
        }
        if self.cr1 & OPM != 0 {
            self.cr1 &= !CEN;
            let at = self.counter.since;
            self.counter.run(at, false);
        }
    }

    /// Skips whole periods in which nothing observable happens.
    fn skip_periods(&mut self, now: Cycle) {
        if self.counter.reload == 0 || self.cr1 & (OPM | UDIS) != 0 || self.keeps_levels() || self.is_update_pending() {
            return;
        }
        let periods = self.counter.counts_until(now) / (u64::from(self.counter.reload) + 1);
        if periods < 2 {
            return;
        }
        self.counter.since += periods * (u64::from(self.counter.reload) + 1) * self.counter.step();
        self.matches_in(0, u64::from(self.counter.reload));
        self.matches_beyond_reload();
        let before = u64::from(self.counter.repetitions);
        if periods <= before {
            self.counter.repetitions -= periods as u32;
        } else {
            self.raise(UIF);
            let cycle = u64::from(self.rcr) + 1;
            self.counter.repetitions = (cycle - 1 - (periods - before - 1) % cycle) as u32;
        }
    }

    /// Takes over the preloaded values; `flag` is set unless software asked for the update and URS is set.
    pub(super) fn update(&mut self, flag: bool) {
        self.counter.prescaler = self.psc;
        self.counter.reload = self.arr;
        self.counter.repetitions = self.rcr;
        self.compare = self.ccr;
        if flag {
            self.raise(UIF);
        }
        if self.cr2 >> 4 & 7 == 2 {
            self.triggers += 1;
        }
        self.outputs_changed = true;
    }

    /// EGR.UG, or the slave mode's reset: begins again from zero with an update.
    pub(super) fn reinitialize(&mut self, now: Cycle) {
        if self.cr1 & UDIS == 0 {
            self.update(self.cr1 & URS == 0);
        }
        self.counter.restart(now);
        self.match_here();
    }

    /// Whether an update would change what is in use.
    fn is_update_pending(&self) -> bool {
        self.counter.prescaler != self.psc || self.counter.reload != self.arr || self.compare != self.ccr
    }

    /// The internal clock drives the counter while it is enabled, unless edges do.
    pub(super) fn follow_enable(&mut self, now: Cycle) {
        let runs = self.is_enabled() && self.is_clocked_internally();
        self.counter.counts_down = self.cr1 & DIR != 0 && !self.is_encoder();
        self.counter.run(now, runs);
    }

    /// One count by an edge, through the prescaler.
    pub(super) fn count_edge(&mut self) {
        if self.counter.edges < self.counter.prescaler {
            self.counter.edges += 1;
            return;
        }
        self.counter.edges = 0;
        self.step_up();
    }

    pub(super) fn step_up(&mut self) {
        if self.counter.count == self.counter.reload {
            self.counter.count = 0;
            self.overflow();
        } else {
            self.counter.count = self.counter.count.wrapping_add(1) & self.variant.highest;
        }
        self.match_here();
    }

    pub(super) fn step_down(&mut self) {
        if self.counter.count == 0 {
            self.counter.count = self.counter.reload;
            self.overflow();
        } else {
            self.counter.count -= 1;
        }
        self.match_here();
    }

    /// The cycle of the next observable change by the running count.
    pub(super) fn count_due(&self) -> Cycle {
        let counter = &self.counter;
        if counter.stopped_after.is_some() || counter.reload == 0 {
            return NEVER;
        }
        let (to_wrap, overflows) = counter.counts_to_wrap(self.variant.highest);
        let period = u64::from(counter.reload) + 1;
        let wraps_at = counter.since + to_wrap * counter.step();
        let mut due = NEVER;
        let noticed = self.noticed_flags();
        if noticed & UIF != 0 && overflows {
            due = wraps_at.saturating_add(u64::from(counter.repetitions) * period * counter.step());
        }
        let channels = noticed >> 1 & 0xF | u32::from(self.watched);
        if self.watched != 0 || channels != 0 && (self.is_update_pending() || !overflows) {
            due = due.min(wraps_at);
        }
        for channel in (0..4).filter(|channel| channels >> channel & 1 == 1) {
            due = due.min(self.match_at(channel, to_wrap));
        }
        due
    }

    /// When the count next reaches the channel's compare value; one beyond the reload value is reached at overflow.
    fn match_at(&self, channel: usize, to_wrap: u64) -> Cycle {
        let counter = &self.counter;
        let target = u64::from(self.compare[channel]);
        let count = u64::from(counter.count);
        let reload = u64::from(counter.reload);
        let counts = match (counter.counts_down, target) {
            (true, target) if target < count => count - target,
            (false, target) if target > count && target <= reload => target - count,
            (_, target) if target > reload => to_wrap,
            (true, target) => to_wrap + reload - target,
            (false, target) => to_wrap + target,
        };
        counter.since + counts * counter.step()
    }

    /// Flags whose next rise raises an interrupt, a DMA request or a trigger.
    fn noticed_flags(&self) -> u32 {
        let interrupts = self.dier & !self.sr;
        let triggers = if self.heard { self.trigger_flags() } else { 0 };
        interrupts & 0x1F | self.dier >> 8 & 0x1F | triggers
    }
}
