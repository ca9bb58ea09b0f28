//! TIM: counters with compare outputs, captures and quadrature (RM0440 §28 advanced, §29 general purpose, §30 TIM15 to
//! TIM17, §31 basic). Counting up and down, one-pulse, repetition, PWM 1 and 2, toggle, forced levels, encoder
//! modes 1 to 3, input capture, slave modes reset, gated, trigger and external clock 1. What is missing is refused by
//! name.
//!
//! - `counter`: how the count runs, wraps and updates, and when that is observable
//! - `output`: compare outputs
//! - `input`: filters, captures, quadrature, slave modes

mod counter;
mod input;
mod output;
mod variant;

use vergence_cpu::{Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};
use crate::unit::TimerId;
use counter::Counter;
use input::Input;
use variant::Variant;
pub(crate) use variant::timer_of_request;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;
const BDTR: u32 = 0x44;
const AF1: u32 = 0x60;
const AF2: u32 = 0x64;

const REGISTERS: Registers = &[
    (CR1, "CR1"),
    (CR2, "CR2"),
    (DIER, "DIER"),
    (SR, "SR"),
    (EGR, "EGR"),
    (CNT, "CNT"),
    (PSC, "PSC"),
    (ARR, "ARR"),
    (SMCR, "SMCR"),
    (CCMR1, "CCMR1"),
    (CCMR2, "CCMR2"),
    (CCER, "CCER"),
    (RCR, "RCR"),
    (CCR1, "CCR1"),
    (0x38, "CCR2"),
    (0x3C, "CCR3"),
    (CCR4, "CCR4"),
    (BDTR, "BDTR"),
    (0x48, "CCR5"),
    (0x4C, "CCR6"),
    (0x50, "CCMR3"),
    (0x54, "DTR2"),
    (0x58, "ECR"),
    (0x5C, "TISEL"),
    (AF1, "AF1"),
    (AF2, "AF2"),
];
/// Basic timers have the first eight.
const BASIC_REGISTERS: usize = 8;

const CEN: u32 = 1 << 0;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const OPM: u32 = 1 << 3;
const DIR: u32 = 1 << 4;
const ARPE: u32 = 1 << 7;
const UIFREMAP: u32 = 1 << 11;

const UIF: u32 = 1 << 0;
const TIF: u32 = 1 << 6;
const MOE: u32 = 1 << 15;

/// A timer.
#[derive(Clone, Debug)]
pub(crate) struct Timer {
    id: TimerId,
    variant: Variant,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    bdtr: u32,
    af: [u32; 2],
    /// Preloaded values.
    psc: u32,
    arr: u32,
    rcr: u32,
    ccr: [u32; 4],
    /// The compare values in use.
    compare: [u32; 4],
    counter: Counter,
    /// OCxREF of the modes that keep a level.
    held: [bool; 4],
    inputs: [Input; 4],
    /// DMA requests not served yet: bit 0 for the update, 1 to 4 for the channels, 6 for the trigger.
    requests: u32,
    /// The outputs that are observed: bit x for CHx+1 and its complement.
    pub watched: u8,
    /// Whether another timer uses the trigger output.
    pub heard: bool,
    /// Pulses of the trigger output since last taken.
    pub triggers: u32,
    /// Whether outputs may have changed since the pads were updated.
    pub outputs_changed: bool,
}

impl Timer {
    pub fn new(id: TimerId) -> Self {
        let variant = Variant::of(id);
        Self {
            id,
            variant,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            bdtr: 0,
            af: [1; 2],
            psc: 0,
            arr: variant.highest,
            rcr: 0,
            ccr: [0; 4],
            compare: [0; 4],
            counter: Counter::new(variant.highest),
            held: [false; 4],
            inputs: [Input::default(); 4],
            requests: 0,
            watched: 0,
            heard: false,
            triggers: 0,
            outputs_changed: true,
        }
    }

    /// Takes over a changed divider of the bus clock at `moment`, to which the count has been advanced.
    pub fn set_divider(&mut self, moment: Moment, tree: &crate::clocks::ClockTree) {
        self.counter.set_divider(moment.now, tree.timer_divider[self.variant.bus]);
    }

    /// Whether a DMA request with this number is pending.
    pub fn requests(&self, number: u8) -> bool {
        self.variant.request_bit(number).is_some_and(|bit| self.requests >> bit & 1 == 1)
    }

    /// Clears a request that was served.
    pub fn acknowledge(&mut self, number: u8) {
        if let Some(bit) = self.variant.request_bit(number) {
            self.requests &= !(1 << bit);
        }
    }

    fn is_enabled(&self) -> bool {
        self.cr1 & CEN != 0
    }

    /// Raises a flag of SR and the DMA request that goes with it.
    fn raise(&mut self, flag: u32) {
        self.sr |= flag;
        self.requests |= flag & self.dier >> 8 & 0x7F;
    }

    fn write_cr1(&mut self, moment: Moment, value: u32) -> Reply<()> {
        only(value, 0x0B9F)?;
        // The encoder decides the direction itself.
        let direction = if self.is_encoder() { self.cr1 } else { value } & DIR;
        self.cr1 = value & !DIR | direction;
        self.follow_enable(moment.now);
        Ok(())
    }

    fn write_cr2(&mut self, value: u32) -> Reply<()> {
        // Trigger output and idle levels.
        only(value, 0x0005_FF70)?;
        self.cr2 = value;
        Ok(())
    }

    fn write_mode(&mut self, which: usize, value: u32) -> Reply<()> {
        self.ccmr[which] = value;
        for channel in 2 * which..2 * which + 2 {
            self.check_channel(channel)?;
            if !self.preloads(channel) {
                self.compare[channel] = self.ccr[channel];
            }
            self.apply_forced_level(channel);
        }
        self.outputs_changed = true;
        Ok(())
    }

    fn write_compare(&mut self, channel: usize, value: u32) {
        self.ccr[channel] = value & self.variant.highest;
        if !self.preloads(channel) {
            self.compare[channel] = self.ccr[channel];
            self.outputs_changed = true;
        }
    }

    fn read_compare(&mut self, channel: usize) -> u32 {
        if self.is_input(channel) {
            self.sr &= !(2 << channel);
        }
        self.ccr[channel]
    }

    fn generate(&mut self, moment: Moment, value: u32) -> Reply<()> {
        only(value, 0x5F)?;
        if value & UIF != 0 {
            self.reinitialize(moment.now);
            if self.cr2 >> 4 & 7 == 0 {
                self.triggers += 1;
            }
        }
        for channel in 0..4 {
            if value >> (channel + 1) & 1 == 1 {
                if self.is_input(channel) { self.capture(channel) } else { self.raise(2 << channel) }
            }
        }
        if value & TIF != 0 {
            self.raise(TIF);
        }
        Ok(())
    }
}

impl Peripheral for Timer {
    fn registers(&self) -> Registers {
        if self.variant.channels == 0 { &REGISTERS[..BASIC_REGISTERS] } else { REGISTERS }
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SMCR => self.smcr,
            DIER => self.dier,
            SR => self.sr,
            CCMR1 => self.ccmr[0],
            CCMR2 => self.ccmr[1],
            CCER => self.ccer,
            CNT if self.cr1 & UIFREMAP != 0 => self.counter.count & !(1 << 31) | (self.sr & UIF) << 31,
            CNT => self.counter.count,
            PSC => self.psc,
            ARR => self.arr,
            RCR => self.rcr,
            CCR1..=CCR4 => self.read_compare((offset - CCR1) as usize / 4),
            BDTR => self.bdtr,
            AF1 => self.af[0],
            AF2 => self.af[1],
            _ => 0,
        })
    }

    fn reads_quietly(&self, offset: u32) -> bool {
        !(CCR1..=CCR4).contains(&offset) && !self.outputs_changed && self.triggers == 0 && self.requests == 0
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CR1 => self.write_cr1(moment, value)?,
            CR2 => self.write_cr2(value)?,
            SMCR => self.write_slave(moment, value)?,
            DIER => {
                only(value, 0x5F5F)?;
                self.dier = value;
                // A request that is switched off is dropped.
                self.requests &= value >> 8;
            }
            // Flags are cleared by writing zero.
            SR => self.sr &= value,
            EGR => self.generate(moment, value)?,
            CCMR1 | CCMR2 => self.write_mode((offset - CCMR1) as usize / 4, value)?,
            CCER => {
                self.ccer = value;
                (0..4).try_for_each(|channel| self.check_channel(channel))?;
                self.outputs_changed = true;
            }
            CNT => self.counter.count = value & self.variant.highest,
            PSC => self.psc = value & 0xFFFF,
            ARR => {
                self.arr = value & self.variant.highest;
                if self.cr1 & ARPE == 0 {
                    self.counter.reload = self.arr;
                }
            }
            RCR => self.rcr = value & self.variant.highest_repetition,
            CCR1..=CCR4 => self.write_compare((offset - CCR1) as usize / 4, value),
            BDTR => {
                // Dead time, lock, idle states and the main output switch; break inputs are not connected.
                only(value, 0xEFFF)?;
                self.bdtr = value;
                (0..4).try_for_each(|channel| self.check_channel(channel))?;
                self.outputs_changed = true;
            }
            AF1 | AF2 => self.af[usize::from(offset == AF2)] = value,
            _ => only(value, 0)?,
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        self.run(moment.now);
        self.settle_inputs(moment.now);
    }

    fn due(&self, _clocks: &Clocks) -> Cycle {
        let settles = self.inputs.iter().map(Input::settles_at).min().unwrap_or(NEVER);
        settles.min(self.count_due())
    }

    fn lines(&self) -> Lines {
        self.variant.lines(self.sr & self.dier)
    }
}
