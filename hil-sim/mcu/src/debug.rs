//! DBGMCU: identification of the chip, and which peripherals freeze under a debugger (RM0440 §47.6).

use crate::peripheral::{Moment, Peripheral, Registers, Reply};

/// The debug support registers. No debugger is ever attached, so freezing has no effect.
#[derive(Clone, Debug, Default)]
pub(crate) struct Debug {
    plain: [u32; 4],
}

/// Revision X of a category 3 chip.
const IDCODE: u32 = 0x2003_6469;

impl Peripheral for Debug {
    fn registers(&self) -> Registers {
        &[(0x00, "IDCODE"), (0x04, "CR"), (0x08, "APB1FZR1"), (0x0C, "APB1FZR2"), (0x10, "APB2FZR")]
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
