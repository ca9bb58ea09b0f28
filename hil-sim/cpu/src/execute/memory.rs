//! Loads and stores (A7.7), and access to the bus.

use super::Trap;
use crate::bus::{Access, Bus};
use crate::cpu::Cpu;
use crate::instruction::{Flags, Instruction, Width};
use crate::system::configuration;

/// Where accesses may change what happens next: flash below, peripherals above.
const RAM: u32 = 0x1000_0000;
const DEVICES: u32 = 0x4000_0000;
const INTERNAL: std::ops::RangeInclusive<u32> = 0xe000_0000..=0xe003_ffff;

impl Width {
    #[inline(always)]
    const fn access(self) -> Access {
        match self {
            Self::Word => Access::Word,
            Self::Half | Self::SignedHalf => Access::Half,
            Self::Byte | Self::SignedByte => Access::Byte,
        }
    }

    #[inline(always)]
    const fn extend(self, value: u32) -> u32 {
        match self {
            Self::SignedHalf => value as i16 as u32,
            Self::SignedByte => value as i8 as u32,
            _ => value,
        }
    }
}

#[inline(always)]
const fn size(access: Access) -> u32 {
    match access {
        Access::Byte => 1,
        Access::Half => 2,
        Access::Word => 4,
    }
}

impl Cpu {
    #[inline(always)]
    pub(crate) fn load<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access) -> Result<u32, Trap> {
        if address & (size(access) - 1) != 0 {
            return self.load_unaligned(bus, address, access);
        }
        if address >= DEVICES {
            return self.load_device(bus, address, access);
        }
        match bus.read(self.now, address, access) {
            Ok(value) => {
                if B::READS_INTERRUPT && bus.nmi() {
                    self.horizon = 0;
                }
                Ok(value)
            }
            Err(_) => self.data_fault(address).map(|()| 0),
        }
    }

    #[inline(never)]
    fn load_device<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access) -> Result<u32, Trap> {
        let result = if INTERNAL.contains(&address) {
            self.read_private(bus, address, access)
        } else {
            let result = bus.read(self.now, address, access);
            self.look_up(bus);
            result
        };
        match result {
            Ok(value) => Ok(value),
            Err(_) => self.data_fault(address).map(|()| 0),
        }
    }

    #[inline(always)]
    pub(crate) fn store<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access, value: u32) -> Result<(), Trap> {
        if address & (size(access) - 1) != 0 {
            return self.store_unaligned(bus, address, access, value);
        }
        if !(RAM..DEVICES).contains(&address) {
            return self.store_device(bus, address, access, value);
        }
        self.code_written(address);
        match bus.write(self.now, address, access, value) {
            Ok(()) => Ok(()),
            Err(_) => self.data_fault(address),
        }
    }

    #[inline(never)]
    fn store_device<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access, value: u32) -> Result<(), Trap> {
        let result = if INTERNAL.contains(&address) {
            self.write_private(bus, address, access, value)
        } else {
            self.code_written(address);
            let result = bus.write(self.now, address, access, value);
            self.look_up(bus);
            result
        };
        match result {
            Ok(()) => Ok(()),
            Err(_) => self.data_fault(address),
        }
    }

    /// After an access to the chip: lets instructions run only up to its next event, and not at all where one is new.
    #[inline]
    fn look_up<B: Bus>(&mut self, bus: &B) {
        let new =
            bus.stop_requested() || bus.code_version() != self.code_version || !self.nvic.knows(bus.lines(), bus.nmi());
        self.horizon = if new { 0 } else { self.horizon.min(bus.next_event()) };
    }

    /// A handler of the highest priorities may ask that failing accesses pass unseen (CCR.BFHFNMIGN).
    #[cold]
    fn data_fault(&self, address: u32) -> Result<(), Trap> {
        let ignore = self.system.configuration & configuration::IGNORE_BUS_FAULTS != 0;
        if ignore && self.execution_priority() < 0 { Ok(()) } else { Err(Trap::Bus(address)) }
    }

    /// The bus moves an unaligned access in aligned parts; here each is a byte.
    #[cold]
    fn load_unaligned<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access) -> Result<u32, Trap> {
        self.check_unaligned(address)?;
        let mut value = 0;
        for byte in 0..size(access) {
            value |= self.load(bus, address.wrapping_add(byte), Access::Byte)? << (8 * byte);
        }
        Ok(value)
    }

    #[cold]
    fn store_unaligned<B: Bus>(&mut self, bus: &mut B, address: u32, access: Access, value: u32) -> Result<(), Trap> {
        self.check_unaligned(address)?;
        for byte in 0..size(access) {
            self.store(bus, address.wrapping_add(byte), Access::Byte, value >> (8 * byte) & 0xff)?;
        }
        Ok(())
    }

    fn check_unaligned(&mut self, address: u32) -> Result<(), Trap> {
        self.now += 1;
        let trap = self.system.configuration & configuration::TRAP_UNALIGNED != 0;
        if trap || INTERNAL.contains(&address) { Err(Trap::Unaligned) } else { Ok(()) }
    }

    /// Accesses of several registers and the exclusives must be aligned whatever CCR says (A3.2.1).
    fn aligned(address: u32, access: Access) -> Result<(), Trap> {
        if address & (size(access) - 1) == 0 { Ok(()) } else { Err(Trap::Unaligned) }
    }

    /// A load into a register; a load of the PC is a branch. A load after a load costs one cycle less.
    #[inline(always)]
    fn load_to<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        address: u32,
        pipelined: bool,
    ) -> Result<(), Trap> {
        let value = width.extend(self.load(bus, address, width.access())?);
        self.now += u64::from(!pipelined);
        self.loaded = true;
        if i.d == 15 {
            return self.branch_exchange(bus, value);
        }
        self.write(i.d, value);
        Ok(())
    }

    #[inline(always)]
    pub(super) fn load_offset<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        pipelined: bool,
    ) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(i.immediate);
        if i.flags.has(Flags::UNPRIVILEGED) {
            return self.load_unprivileged(bus, i, width, address, pipelined);
        }
        self.load_to(bus, i, width, address, pipelined)
    }

    #[inline(always)]
    pub(super) fn load_register<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        pipelined: bool,
    ) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(self.read(i.m) << (i.immediate & 31));
        self.load_to(bus, i, width, address, pipelined)
    }

    #[inline(always)]
    pub(super) fn load_literal<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        pipelined: bool,
    ) -> Result<(), Trap> {
        let address = (self.r[15] & !3).wrapping_add(i.immediate);
        self.load_to(bus, i, width, address, pipelined)
    }

    #[inline(always)]
    pub(super) fn load_indexed<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        pipelined: bool,
    ) -> Result<(), Trap> {
        let base = self.read(i.n);
        let moved = base.wrapping_add(i.immediate);
        let address = if i.flags.has(Flags::PRE_INDEX) { moved } else { base };
        let value = width.extend(self.load(bus, address, width.access())?);
        self.now += u64::from(!pipelined);
        self.write(i.n, moved);
        if i.d == 15 {
            return self.branch_exchange(bus, value);
        }
        self.write(i.d, value);
        Ok(())
    }

    #[inline(always)]
    pub(super) fn store_offset<B: Bus>(&mut self, bus: &mut B, i: &Instruction, width: Width) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(i.immediate);
        if i.flags.has(Flags::UNPRIVILEGED) {
            return self.store_unprivileged(bus, address, width, self.read(i.d));
        }
        self.store(bus, address, width.access(), self.read(i.d))
    }

    #[inline(always)]
    pub(super) fn store_register<B: Bus>(&mut self, bus: &mut B, i: &Instruction, width: Width) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(self.read(i.m) << (i.immediate & 31));
        self.store(bus, address, width.access(), self.read(i.d))
    }

    #[inline(always)]
    pub(super) fn store_indexed<B: Bus>(&mut self, bus: &mut B, i: &Instruction, width: Width) -> Result<(), Trap> {
        let base = self.read(i.n);
        let moved = base.wrapping_add(i.immediate);
        let address = if i.flags.has(Flags::PRE_INDEX) { moved } else { base };
        self.store(bus, address, width.access(), self.read(i.d))?;
        self.write(i.n, moved);
        Ok(())
    }

    #[inline(never)]
    fn load_unprivileged<B: Bus>(
        &mut self,
        bus: &mut B,
        i: &Instruction,
        width: Width,
        address: u32,
        pipelined: bool,
    ) -> Result<(), Trap> {
        self.as_unprivileged(|cpu| cpu.load_to(bus, i, width, address, pipelined))
    }

    #[inline(never)]
    fn store_unprivileged<B: Bus>(&mut self, bus: &mut B, address: u32, width: Width, value: u32) -> Result<(), Trap> {
        self.as_unprivileged(|cpu| cpu.store(bus, address, width.access(), value))
    }

    fn as_unprivileged<T>(&mut self, access: impl FnOnce(&mut Self) -> Result<T, Trap>) -> Result<T, Trap> {
        let before = (self.unprivileged, self.exception);
        // Only the private bus calls this; no exception is taken in between.
        (self.unprivileged, self.exception) = (true, 0);
        let result = access(self);
        (self.unprivileged, self.exception) = before;
        result
    }

    /// Address and written-back base of a dual access.
    fn dual_address(&self, i: &Instruction) -> (u32, u32) {
        let base = if i.n == 15 { self.r[15] & !3 } else { self.read(i.n) };
        let moved = base.wrapping_add(i.immediate);
        (if i.flags.has(Flags::PRE_INDEX) { moved } else { base }, moved)
    }

    #[inline(never)]
    pub(super) fn load_dual<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let (address, moved) = self.dual_address(i);
        Self::aligned(address, Access::Word)?;
        let first = self.load(bus, address, Access::Word)?;
        let second = self.load(bus, address.wrapping_add(4), Access::Word)?;
        self.now += 2;
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        self.write(i.d, first);
        self.write(i.a, second);
        Ok(())
    }

    #[inline(never)]
    pub(super) fn store_dual<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let (address, moved) = self.dual_address(i);
        Self::aligned(address, Access::Word)?;
        self.store(bus, address, Access::Word, self.read(i.d))?;
        self.store(bus, address.wrapping_add(4), Access::Word, self.read(i.a))?;
        self.now += 2;
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        Ok(())
    }

    /// First address and written-back base of a multiple access of `count` words.
    pub(super) fn multiple_addresses(&self, i: &Instruction, span: u32) -> (u32, u32) {
        let base = self.read(i.n);
        if i.flags.has(Flags::VARIANT) {
            let low = base.wrapping_sub(span);
            (low, low)
        } else {
            (base, base.wrapping_add(span))
        }
    }

    #[inline(never)]
    pub(super) fn load_multiple<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let count = i.immediate.count_ones();
        let (mut address, moved) = self.multiple_addresses(i, 4 * count);
        Self::aligned(address, Access::Word)?;
        let mut values = [0; 16];
        let mut list = i.immediate;
        while list != 0 {
            values[(list.trailing_zeros() & 15) as usize] = self.load(bus, address, Access::Word)?;
            address = address.wrapping_add(4);
            list &= list - 1;
        }
        self.now += u64::from(count);
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        let mut list = i.immediate & 0x7fff;
        while list != 0 {
            let register = list.trailing_zeros() as u8;
            self.write(register, values[usize::from(register & 15)]);
            list &= list - 1;
        }
        if i.immediate >> 15 != 0 { self.branch_exchange(bus, values[15]) } else { Ok(()) }
    }

    #[inline(never)]
    pub(super) fn store_multiple<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let count = i.immediate.count_ones();
        let (mut address, moved) = self.multiple_addresses(i, 4 * count);
        Self::aligned(address, Access::Word)?;
        let mut list = i.immediate;
        while list != 0 {
            self.store(bus, address, Access::Word, self.read(list.trailing_zeros() as u8))?;
            address = address.wrapping_add(4);
            list &= list - 1;
        }
        self.now += u64::from(count);
        if i.flags.has(Flags::WRITE_BACK) {
            self.write(i.n, moved);
        }
        Ok(())
    }

    /// The local monitor of a single core watches no address (A3.4.1).
    pub(super) fn load_exclusive<B: Bus>(&mut self, bus: &mut B, i: &Instruction, width: Width) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(i.immediate);
        Self::aligned(address, width.access())?;
        let value = self.load(bus, address, width.access())?;
        self.exclusive = true;
        self.now += 1;
        self.write(i.d, value);
        Ok(())
    }

    pub(super) fn store_exclusive<B: Bus>(&mut self, bus: &mut B, i: &Instruction, width: Width) -> Result<(), Trap> {
        let address = self.read(i.n).wrapping_add(i.immediate);
        Self::aligned(address, width.access())?;
        self.now += 1;
        if std::mem::take(&mut self.exclusive) {
            self.store(bus, address, width.access(), self.read(i.a))?;
            self.write(i.d, 0);
        } else {
            self.write(i.d, 1);
        }
        Ok(())
    }
}
