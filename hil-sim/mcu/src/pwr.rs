//! PWR: supply of the core (RM0440 §6).

use vergence_cpu::Cycle;

use crate::clocks::{Clocks, VoltageRange};
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};
use crate::time::Picoseconds;

const CR1: u32 = 0x00;
const CR3: u32 = 0x08;
const SR1: u32 = 0x10;
const SR2: u32 = 0x14;
const SCR: u32 = 0x18;
const CR5: u32 = 0x80;

/// Time in which the regulator changes its output (DS12288, operating conditions).
const REGULATOR_SETTLES: Picoseconds = Picoseconds::microseconds(40);

/// The power controller. Low-power modes are not modelled.
#[derive(Clone, Debug)]
pub(crate) struct Pwr {
    cr1: u32,
    cr3: u32,
    cr5: u32,
    settled_at: Option<Picoseconds>,
}

impl Default for Pwr {
    fn default() -> Self {
        Self { cr1: 0x200, cr3: 0x8000, cr5: 0x100, settled_at: None }
    }
}

impl Pwr {
    pub fn range(&self) -> VoltageRange {
        match (self.cr1 >> 9 & 3, self.cr5 >> 8 & 1) {
            (2, _) => VoltageRange::Low,
            (_, 0) => VoltageRange::Boost,
            _ => VoltageRange::Normal,
        }
    }
}

impl Peripheral for Pwr {
    fn registers(&self) -> Registers {
        &[(CR1, "CR1"), (CR3, "CR3"), (SR1, "SR1"), (SR2, "SR2"), (SCR, "SCR"), (CR5, "CR5")]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CR1 => self.cr1,
            CR3 => self.cr3,
            CR5 => self.cr5,
            SR2 => u32::from(self.settled_at.is_some()) << 10,
            _ => 0,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        let before = self.range();
        match offset {
            CR1 => {
                only(value, 0x0707)?;
                if value >> 9 & 3 == 0 || value >> 9 & 3 == 3 {
                    return Err("that voltage range does not exist".into());
                }
                self.cr1 = value;
            }
            CR3 => {
                // Dead battery pull-downs of USB type C (bit 14) and wake-up from standby (bit 15) change nothing here.
                only(value, 0xC000)?;
                self.cr3 = value;
            }
            CR5 => {
                only(value, 0x100)?;
                self.cr5 = value;
            }
            _ => {}
        }
        if self.range() != before {
            self.settled_at = Some(moment.time() + REGULATOR_SETTLES);
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        if self.settled_at.is_some_and(|at| moment.clocks.base.cycle_at(at) <= moment.now) {
            self.settled_at = None;
        }
    }

    fn due(&self, clocks: &Clocks) -> Cycle {
        clocks.base.cycle_at(self.settled_at.unwrap_or(Picoseconds::NEVER))
    }
}
