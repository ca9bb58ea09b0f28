//! DBGMCU: identification of the chip, and which peripherals freeze under a debugger (RM0440 §47.6).

use crate::peripheral::{Moment, Peripheral, Registers, Reply};

/// APB1FZR1, and its bit that freezes the independent watchdog.
const APB1FZR1: u32 = 0x08;
const DBG_IWDG_STOP: u32 = 1 << 12;

/// The debug support registers. Of all that can be frozen while the core is halted, only the watchdog is.
#[derive(Clone, Debug, Default)]
pub(crate) struct Debug {
    plain: [u32; 4],
}

impl Debug {
    /// Whether the independent watchdog stands while the core is halted.
    pub fn freezes_watchdog(&self) -> bool {
        self.plain[APB1FZR1 as usize / 4 - 1] & DBG_IWDG_STOP != 0
    }
}

/// Revision X of a category 3 chip.
const IDCODE: u32 = 0x2003_6469;

impl Peripheral for Debug {
    fn registers(&self) -> Registers {
        &[(0x00, "IDCODE"), (0x04, "CR"), (APB1FZR1, "APB1FZR1"), (0x0C, "APB1FZR2"), (0x10, "APB2FZR")]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            0 => IDCODE,
            offset => self.plain[(offset as usize / 4 - 1) % 4],
        })
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        if offset > 0 {
            self.plain[(offset as usize / 4 - 1) % 4] = value;
        }
        Ok(())
    }
}
