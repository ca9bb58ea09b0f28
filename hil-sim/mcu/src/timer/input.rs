//! Filtered inputs, captures, quadrature, slave modes (RM0440 §28.3.6, §28.3.8, §28.3.22, §28.3.29).

use vergence_cpu::{Cycle, NEVER};

use super::{DIR, TIF, Timer};
use crate::peripheral::{Refused, Reply, only};
use crate::unit::TimerId;

/// A timer input TIx behind its digital filter.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Input {
    raw: bool,
    filtered: bool,
    /// When the filter accepts `raw`.
    settles: Option<Cycle>,
    /// Edges seen by the capture prescaler.
    edges: u32,
}

impl Input {
    pub fn settles_at(&self) -> Cycle {
        self.settles.unwrap_or(NEVER)
    }
}

/// Filters: how many samples must agree, and how many clocks lie between two (CCMRx.ICxF); from 4 on in clocks of CKD.
const FILTERS: [(u64, u64); 16] = [
    (0, 1),
    (2, 1),
    (4, 1),
    (8, 1),
    (6, 2),
    (8, 2),
    (6, 4),
    (8, 4),
    (6, 8),
    (8, 8),
    (5, 16),
    (6, 16),
    (8, 16),
    (5, 32),
    (6, 32),
    (8, 32),
];

/// SMCR.SMS.
const RESET: u32 = 4;
const GATED: u32 = 5;
const TRIGGER: u32 = 6;
const EXTERNAL_CLOCK: u32 = 7;
const RESET_AND_TRIGGER: u32 = 8;

/// SMCR.TS: an edge of TI1, TI1 and TI2 after their filters.
const TI1_EDGE: u32 = 4;
const TI1: u32 = 5;
const TI2: u32 = 6;

impl Timer {
    fn slave_mode(&self) -> u32 {
        self.smcr & 7 | self.smcr >> 13 & 8
    }

    fn trigger_source(&self) -> u32 {
        self.smcr >> 4 & 7 | self.smcr >> 17 & 0x18
    }

    pub(super) fn is_encoder(&self) -> bool {
        matches!(self.slave_mode(), 1..=3)
    }

    pub(super) fn is_clocked_internally(&self) -> bool {
        !self.is_encoder() && self.slave_mode() != EXTERNAL_CLOCK && (self.slave_mode() != GATED || self.gate_is_open())
    }

    fn gate_is_open(&self) -> bool {
        match self.trigger_source() {
            TI1 => self.logical(0),
            TI2 => self.logical(1),
            _ => true,
        }
    }

    pub(super) fn write_slave(&mut self, moment: crate::peripheral::Moment, value: u32) -> Reply<()> {
        only(value, 0x0031_00F7)?;
        self.smcr = value;
        let mode = self.slave_mode();
        if mode > RESET_AND_TRIGGER {
            return Err(Refused(format!("slave mode {mode} is not modelled")));
        }
        if mode >= RESET && (self.trigger_source() == 7 || self.trigger_source() > 13) {
            return Err("the external trigger input is not modelled".into());
        }
        if self.is_encoder() && self.psc != 0 {
            return Err("a prescaler in encoder mode is not modelled".into());
        }
        self.follow_enable(moment.now);
        Ok(())
    }

    /// The timer whose trigger output this one uses: internal triggers are the same for all (§28.3.30).
    pub fn master(&self) -> Option<TimerId> {
        const MASTERS: [u8; 10] = [1, 2, 3, 4, 5, 8, 15, 16, 17, 20];
        if self.slave_mode() < RESET {
            return None;
        }
        let index = match self.trigger_source() {
            low @ 0..=3 => low,
            high @ 8..=13 => high - 4,
            _ => return None,
        };
        TimerId::new(*MASTERS.get(index as usize)?).filter(|&master| master != self.id)
    }

    /// Sets the level of the pin at channel `channel` from `now` on.
    pub fn set_input(&mut self, now: Cycle, channel: usize, high: bool) {
        let Some(input) = self.inputs.get(channel) else { return };
        if input.raw == high {
            return;
        }
        let delay = self.filter_delay(channel);
        let input = &mut self.inputs[channel];
        input.raw = high;
        // A level that returns before the filter has accepted it has no effect.
        input.settles = (input.filtered != high).then(|| now + delay);
        self.settle_inputs(now);
    }

    fn filter_delay(&self, channel: usize) -> u64 {
        if !self.is_input(channel) && !self.is_encoder() {
            return 0;
        }
        let number = (self.ccmr[channel / 2] >> (8 * (channel % 2) + 4) & 0xF) as usize;
        let (samples, spacing) = FILTERS[number];
        let clocks = if number < 4 { 1 } else { 1 << (self.cr1 >> 8 & 3) };
        samples * spacing * clocks * self.counter.divider()
    }

    /// Lets the filters accept levels that have lasted long enough.
    pub(super) fn settle_inputs(&mut self, now: Cycle) {
        for channel in 0..4 {
            if self.inputs[channel].settles_at() <= now {
                let input = &mut self.inputs[channel];
                input.settles = None;
                input.filtered = input.raw;
                self.edge(now, channel);
            }
        }
    }

    /// TIxFPx: the level after filter and polarity.
    fn logical(&self, channel: usize) -> bool {
        self.inputs[channel].filtered != (self.ccer >> (4 * channel + 1) & 1 == 1)
    }

    /// An input has changed its level.
    fn edge(&mut self, now: Cycle, channel: usize) {
        if self.is_encoder() {
            self.quadrature(channel);
        }
        for capturing in [channel, channel ^ 1] {
            let wanted = if capturing == channel { 1 } else { 2 };
            if self.ccmr[capturing / 2] >> (8 * (capturing % 2)) & 3 == wanted {
                self.capture_edge(capturing, self.inputs[channel].filtered);
            }
        }
        let rises = self.logical(channel);
        match (self.trigger_source(), channel) {
            (TI1_EDGE, 0) => self.trigger(now),
            (TI1, 0) | (TI2, 1) if self.slave_mode() == GATED => self.follow_enable(now),
            (TI1, 0) | (TI2, 1) if rises => self.trigger(now),
            _ => {}
        }
    }

    /// Counts an edge of the encoder (table of counting direction versus encoder signals): up while TI1 leads TI2.
    fn quadrature(&mut self, channel: usize) {
        let counts = match self.slave_mode() {
            1 => channel == 0,
            2 => channel == 1,
            _ => channel < 2,
        };
        if !counts || !self.is_enabled() {
            return;
        }
        let [ti1, ti2] = [self.logical(0), self.logical(1)];
        let up = if channel == 0 { ti1 != ti2 } else { ti1 == ti2 };
        if up {
            self.cr1 &= !DIR;
            self.step_up();
        } else {
            self.cr1 |= DIR;
            self.step_down();
        }
    }

    /// An edge at the input that a channel captures: rising, falling or both, each, each second, fourth or eighth.
    fn capture_edge(&mut self, channel: usize, high: bool) {
        let bits = self.ccer >> (4 * channel);
        let polarity = [bits >> 1 & 1, bits >> 3 & 1];
        let effective = match polarity {
            [0, _] => high,
            [_, 0] => !high,
            _ => true,
        };
        if bits & 1 == 0 || !effective {
            return;
        }
        let every = 1 << (self.ccmr[channel / 2] >> (8 * (channel % 2) + 2) & 3);
        let input = &mut self.inputs[channel];
        input.edges += 1;
        if input.edges >= every {
            input.edges = 0;
            self.capture(channel);
        }
    }

    /// CCRx takes the count; a capture not yet read sets the overcapture flag as well.
    pub(super) fn capture(&mut self, channel: usize) {
        let flag = 2 << channel;
        if self.sr & flag != 0 {
            self.sr |= flag << 8;
        }
        self.ccr[channel] = self.counter.count;
        self.raise(flag);
    }

    /// Applies the chosen trigger to the counter.
    pub fn trigger(&mut self, now: Cycle) {
        match self.slave_mode() {
            RESET => self.reinitialize(now),
            TRIGGER => self.start(now),
            RESET_AND_TRIGGER => {
                self.reinitialize(now);
                self.start(now);
            }
            EXTERNAL_CLOCK if self.is_enabled() => self.count_edge(),
            _ => return,
        }
        self.raise(TIF);
    }

    fn start(&mut self, now: Cycle) {
        self.cr1 |= super::CEN;
        self.follow_enable(now);
    }
}
