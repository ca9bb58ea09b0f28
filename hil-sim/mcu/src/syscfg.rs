//! SYSCFG: the port of each EXTI line, and the memory mapped at address zero (RM0440 §10).

use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};

const MEMRMP: u32 = 0x00;
const CFGR1: u32 = 0x04;
const EXTICR1: u32 = 0x08;
const CFGR2: u32 = 0x1C;

/// The system configuration controller.
#[derive(Clone, Debug, Default)]
pub(crate) struct Syscfg {
    cfgr1: u32,
    exticr: [u32; 4],
}

impl Syscfg {
    /// The port, 0 for A, whose pin drives EXTI line `line`.
    pub fn exti_port(&self, line: usize) -> usize {
        (self.exticr[line / 4] >> (4 * (line % 4)) & 0xF) as usize
    }
}

impl Peripheral for Syscfg {
    fn registers(&self) -> Registers {
        &[
            (MEMRMP, "MEMRMP"),
            (CFGR1, "CFGR1"),
            (EXTICR1, "EXTICR1"),
            (0x0C, "EXTICR2"),
            (0x10, "EXTICR3"),
            (0x14, "EXTICR4"),
            (0x18, "SCSR"),
            (CFGR2, "CFGR2"),
        ]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CFGR1 => self.cfgr1,
            EXTICR1..=0x14 => self.exticr[(offset - EXTICR1) as usize / 4],
            _ => 0,
        })
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CFGR1 => self.cfgr1 = value,
            EXTICR1..=0x14 => self.exticr[(offset - EXTICR1) as usize / 4] = value & 0xFFFF,
            // Remapping, bank swap, CCM erase, and break inputs.
            _ => only(value, 0)?,
        }
        Ok(())
    }
}
