//! Time that passes while the core stands: a brown-out of the supply, and a debugger's halt.

use vergence_cpu::Bus;

use crate::halt::Halt;
use crate::machine::Machine;
use crate::rcc::ResetCause;
use crate::time::Picoseconds;
use crate::world::World;

/// Brown-out thresholds of each level of the option bytes for a falling and a rising supply, in millivolts (DS12288,
/// embedded reset characteristics, typical).
const BROWN_OUT_MV: [[u32; 2]; 5] = [[1_640, 1_660], [2_000, 2_100], [2_200, 2_310], [2_520, 2_610], [2_810, 2_900]];

impl<W: World> Machine<W> {
    /// Sets the chip's supply in millivolts. Below the brown-out threshold that the option bytes choose the chip is held in
    /// reset, its pins float and its RAM is lost; above the threshold for a rising supply it starts again. It is 3300 mV at
    /// the beginning.
    pub fn set_supply(&mut self, millivolts: u32) {
        let level = self.chip.units.flash.brown_out_level();
        let [falling, rising] = BROWN_OUT_MV.get(level).copied().unwrap_or(BROWN_OUT_MV[0]);
        if !self.in_brown_out && millivolts < falling {
            self.in_brown_out = true;
            self.chip.reset(self.cpu.now(), ResetCause::BrownOut);
        } else if self.in_brown_out && millivolts > rising {
            self.in_brown_out = false;
            self.restart(ResetCause::BrownOut);
        }
    }

    /// Halts the core for a duration as a debugger does. The peripherals go on; the watchdog stands where the firmware or
    /// the debugger has asked for that in DBGMCU_APB1FZR1 (RM0440 §47.6.4).
    pub fn halt_core(&mut self, duration: Picoseconds) -> Halt {
        if self.chip.units.debug.freezes_watchdog() {
            self.chip.units.iwdg.stand(duration);
            self.chip.refresh(crate::unit::Unit::Iwdg);
        }
        self.stand_until(self.time() + duration)
    }

    /// Lets time pass without the core, until `time` or a reset.
    pub(crate) fn stand_until(&mut self, time: Picoseconds) -> Halt {
        loop {
            let end = self.chip.clocks.base.cycle_at(time);
            let now = self.cpu.now();
            if now >= end {
                return Halt::Reached;
            }
            let next = end.min(self.chip.next_event().max(now + 1));
            self.cpu.pass_turns(next - now, 0);
            self.chip.advance_to(next);
            if self.chip.demand.is_some() {
                return self.handle_demand().unwrap_or(Halt::Reached);
            }
        }
    }
}
