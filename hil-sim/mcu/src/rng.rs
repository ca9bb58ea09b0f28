//! RNG: random numbers, the same ones for the same seed (RM0440 §26).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_cpu::{Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Registers, Reply};
use crate::time::Picoseconds;

const CR: u32 = 0x00;
const SR: u32 = 0x04;
const DR: u32 = 0x08;

const RNGEN: u32 = 1 << 2;
const IE: u32 = 1 << 3;
const CED: u32 = 1 << 5;
const CEIS: u32 = 1 << 5;

/// Four words come each 412 clocks (§26.3.5).
const CLOCKS_FOR_FOUR: u64 = 412;

/// The random number generator.
#[derive(Clone, Debug)]
pub(crate) struct Rng {
    random: Pcg64Mcg,
    cr: u32,
    words: Vec<u32>,
    ready_at: Option<Picoseconds>,
    clock_error: bool,
}

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self { random: Pcg64Mcg::seed_from_u64(seed), cr: 0, words: Vec::new(), ready_at: None, clock_error: false }
    }

    /// Resets the registers; the noise continues.
    pub fn reset(&mut self) {
        *self = Self { random: self.random.clone(), ..Self::new(0) };
    }

    fn start(&mut self, moment: Moment) {
        let hz = moment.clocks.tree.clk48;
        self.clock_error = hz == 0 && self.cr & CED == 0;
        self.ready_at = (hz > 0).then(|| moment.time() + Picoseconds::periods(CLOCKS_FOR_FOUR, hz));
    }
}

impl Peripheral for Rng {
    fn registers(&self) -> Registers {
        &[(CR, "CR"), (SR, "SR"), (DR, "DR")]
    }

    fn read(&mut self, moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CR => self.cr,
            SR => u32::from(!self.words.is_empty()) | if self.clock_error { CEIS | 2 } else { 0 },
            _ => {
                let word = self.words.pop().unwrap_or(0);
                if self.words.is_empty() && self.cr & RNGEN != 0 && self.ready_at.is_none() {
                    self.start(moment);
                }
                word
            }
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CR => {
                let rises = value & !self.cr & RNGEN != 0;
                self.cr = value & (RNGEN | IE | CED);
                if rises {
                    self.start(moment);
                } else if value & RNGEN == 0 {
                    self.words.clear();
                    self.ready_at = None;
                }
            }
            SR => self.clock_error &= value & CEIS != 0,
            _ => {}
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        if self.ready_at.is_some_and(|at| moment.clocks.base.cycle_at(at) <= moment.now) {
            self.ready_at = None;
            self.words = (0..4).map(|_| self.random.random()).collect();
        }
    }

    fn due(&self, clocks: &Clocks) -> Cycle {
        self.ready_at.map_or(NEVER, |at| clocks.base.cycle_at(at))
    }

    fn lines(&self) -> Lines {
        if self.cr & IE != 0 && (!self.words.is_empty() || self.clock_error) { 1 << 90 } else { 0 }
    }
}
