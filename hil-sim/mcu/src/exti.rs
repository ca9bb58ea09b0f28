//! EXTI: edges of pins become interrupts (RM0440 §15). Only the sixteen pin lines have sources in the model.

use vergence_cpu::Lines;

use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};

const IMR1: u32 = 0x00;
const EMR1: u32 = 0x04;
const RTSR1: u32 = 0x08;
const FTSR1: u32 = 0x0C;
const SWIER1: u32 = 0x10;
const PR1: u32 = 0x14;

/// Lines with an edge detector among the first 32: 0 to 17, 19 to 22 and 29 to 31 (§15.5.3).
const CONFIGURABLE: u32 = 0xE07B_FFFF;

/// The interrupt lines that pins raise: EXTI lines, NVIC line.
const VECTORS: [(u32, u32); 7] =
    [(0x0001, 6), (0x0002, 7), (0x0004, 8), (0x0008, 9), (0x0010, 10), (0x03E0, 23), (0xFC00, 40)];

/// The extended interrupt controller.
#[derive(Clone, Debug)]
pub(crate) struct Exti {
    imr1: u32,
    imr2: u32,
    rising: u32,
    falling: u32,
    pending: u32,
}

impl Default for Exti {
    fn default() -> Self {
        Self { imr1: 0x1F84_0000, imr2: 0xFFFF_FF87, rising: 0, falling: 0, pending: 0 }
    }
}

impl Exti {
    /// Takes a change of level of the pin chosen for line `line`.
    pub fn edge(&mut self, line: usize, rises: bool) {
        let detector = if rises { self.rising } else { self.falling };
        self.pending |= detector & 1 << line;
    }
}

impl Peripheral for Exti {
    fn registers(&self) -> Registers {
        &[
            (IMR1, "IMR1"),
            (EMR1, "EMR1"),
            (RTSR1, "RTSR1"),
            (FTSR1, "FTSR1"),
            (SWIER1, "SWIER1"),
            (PR1, "PR1"),
            (0x20, "IMR2"),
            (0x24, "EMR2"),
            (0x28, "RTSR2"),
            (0x2C, "FTSR2"),
            (0x30, "SWIER2"),
            (0x34, "PR2"),
        ]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            IMR1 => self.imr1,
            RTSR1 => self.rising,
            FTSR1 => self.falling,
            PR1 => self.pending,
            0x20 => self.imr2,
            _ => 0,
        })
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            IMR1 => self.imr1 = value,
            RTSR1 => self.rising = value & CONFIGURABLE,
            FTSR1 => self.falling = value & CONFIGURABLE,
            // A software edge counts where the line is unmasked (§15.5.5).
            SWIER1 => self.pending |= value & self.imr1 & CONFIGURABLE,
            PR1 => self.pending &= !value,
            0x20 => self.imr2 = value,
            0x34 => {}
            // Events without interrupts, and edges of lines 32 and above.
            _ => only(value, 0)?,
        }
        Ok(())
    }

    fn lines(&self) -> Lines {
        let active = self.pending & self.imr1;
        VECTORS.iter().filter(|(lines, _)| active & lines != 0).fold(0, |all, (_, vector)| all | 1 << vector)
    }
}
