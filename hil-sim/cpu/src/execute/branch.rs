//! Branches, hints and barriers.

use super::Trap;
use crate::bus::{Access, Bus};
use crate::cpu::{Activity, Cpu};
use crate::instruction::{Flags, Instruction};

/// Refilling the pipeline takes one to three cycles (TRM 3.3.1), two on average.
const REFILL: u64 = 2;
/// Loading the PC with a value from here up in handler mode is an exception return.
const RETURN_VALUES: u32 = 0xf000_0000;

impl Cpu {
    #[inline(always)]
    pub(super) fn branch_relative<B: Bus>(&mut self, bus: &B, offset: u32) {
        self.branch_to(bus, self.r[15].wrapping_add(offset));
    }

    #[inline(always)]
    pub(super) fn branch_to<B: Bus>(&mut self, bus: &B, target: u32) {
        self.pc = target & !1;
        self.now = self.now.wrapping_add(REFILL + u64::from(bus.wait_states(self.now)));
    }

    /// BXWritePC() (A2.3.1): an even target faults at the target.
    #[inline(always)]
    pub(super) fn branch_exchange<B: Bus>(&mut self, bus: &B, target: u32) -> Result<(), Trap> {
        if target >= RETURN_VALUES && self.exception != 0 {
            return Err(Trap::Return(target));
        }
        if target & 1 == 0 {
            self.thumb = false;
            self.horizon = 0;
        }
        self.branch_to(bus, target);
        Ok(())
    }

    #[inline(always)]
    pub(super) fn branch_link_exchange<B: Bus>(&mut self, bus: &B, i: &Instruction) -> Result<(), Trap> {
        let target = self.read(i.m);
        self.r[14] = self.pc | 1;
        if target & 1 == 0 {
            self.thumb = false;
            self.horizon = 0;
        }
        self.branch_to(bus, target);
        Ok(())
    }

    pub(super) fn table_branch<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let half = i.flags.has(Flags::VARIANT);
        let index = self.read(i.m) << u32::from(half);
        let access = if half { Access::Half } else { Access::Byte };
        let entry = self.load(bus, self.read(i.n).wrapping_add(index), access)?;
        self.now += 1;
        self.branch_relative(bus, entry << 1);
        Ok(())
    }

    pub(super) fn wait_for_event(&mut self) {
        if !std::mem::take(&mut self.event) {
            self.sleep(Activity::AwaitingEvent);
        }
    }

    pub(super) fn sleep(&mut self, activity: Activity) {
        self.activity = activity;
        self.horizon = 0;
    }

    /// CPS (B5.2.1).
    pub(super) fn change_state(&mut self, i: &Instruction) {
        if !self.privileged() {
            return;
        }
        let disable = i.flags.has(Flags::VARIANT);
        if i.immediate & 2 != 0 {
            self.primask = disable;
        }
        if i.immediate & 1 != 0 {
            self.set_faultmask(disable);
        }
        self.horizon = 0;
    }

    /// A barrier: accesses are in order already, so that it only lets pending exceptions in.
    pub(super) fn barrier<B: Bus>(&mut self, bus: &B) {
        self.now += REFILL + u64::from(bus.wait_states(self.now));
        self.horizon = 0;
    }
}
