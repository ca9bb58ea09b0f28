//! The chip as the bus of the core.

use vergence_cpu::{Access, Bus, BusFault, Cycle, Lines};

use crate::chip::Chip;
use crate::memory::{Memory, Place, RAM_BASE, narrow};
use crate::peripheral::{Moment, Refused};
use crate::trouble::{Demand, Trouble};
use crate::unit::Unit;
use crate::world::World;

/// Addresses of peripherals: what is missing here is a gap in the model, not a fault of the program.
const PERIPHERALS: std::ops::Range<u32> = 0x4000_0000..0x6000_0000;

impl<W: World> Chip<W> {
    /// Reads a register of a peripheral.
    pub(crate) fn read_register(&mut self, address: u32, access: Access) -> Result<u32, BusFault> {
        let Some((unit, offset)) = self.find(address)? else { return Ok(0) };
        self.census.note(unit, offset, false);
        let moment = Moment { now: self.now, clocks: &self.clocks };
        if let Unit::Spi(spi) = unit {
            self.units.spis[spi.index()].access = access;
        }
        let peripheral = self.units.get(unit);
        peripheral.advance(moment);
        let quiet = peripheral.reads_quietly(offset);
        match peripheral.read(moment, offset) {
            Ok(word) => {
                if !quiet {
                    self.react(unit);
                }
                Ok(narrow(word, address, access))
            }
            Err(Refused(what)) => {
                let register = self.name_of(unit, offset);
                self.complain(Trouble::Refused { unit: unit.to_string(), register, offset, value: 0, what });
                Ok(0)
            }
        }
    }

    /// Writes a register of a peripheral.
    pub(crate) fn write_register(&mut self, address: u32, access: Access, value: u32) -> Result<(), BusFault> {
        let Some((unit, offset)) = self.find(address)? else { return Ok(()) };
        self.census.note(unit, offset, true);
        if address & 3 != 0 && access != Access::Word {
            let register = self.name_of(unit, offset);
            self.complain(Trouble::Narrow { unit: unit.to_string(), register, access });
            return Ok(());
        }
        let moment = Moment { now: self.now, clocks: &self.clocks };
        if unit == Unit::Crc {
            self.units.crc.access = access;
        }
        if let Unit::Spi(spi) = unit {
            self.units.spis[spi.index()].access = access;
        }
        let peripheral = self.units.get(unit);
        peripheral.advance(moment);
        let reply = peripheral.write(moment, offset, value);
        // The slave mode decides which timer triggers which.
        if matches!(unit, Unit::Timer(_)) && offset == 8 {
            self.watch_timers();
        }
        if unit == Unit::Flash && offset == 0 {
            self.reclock();
        }
        self.react(unit);
        if let Err(Refused(what)) = reply {
            let register = self.name_of(unit, offset);
            self.complain(Trouble::Refused { unit: unit.to_string(), register, offset, value, what });
        }
        Ok(())
    }

    /// The peripheral at an address and the offset of the register; `None` where there is none, which has been
    /// reported.
    fn find(&mut self, address: u32) -> Result<Option<(Unit, u32)>, BusFault> {
        let Some(unit) = self.directory.unit_at(address) else {
            if PERIPHERALS.contains(&address) {
                self.complain(Trouble::Unmapped { address });
            }
            return Err(BusFault);
        };
        let offset = (address - unit.base()) & !3;
        if !self.directory.has_register(unit, offset) {
            self.complain(Trouble::NoRegister { unit: unit.to_string(), offset });
            return Ok(None);
        }
        if self.clocked >> unit.index() & 1 == 0 {
            let register = self.name_of(unit, offset);
            self.complain(Trouble::ClockOff { unit: unit.to_string(), register });
            return Ok(None);
        }
        Ok(Some((unit, offset)))
    }

    fn name_of(&mut self, unit: Unit, offset: u32) -> &'static str {
        let registers = self.units.get(unit).registers();
        registers.iter().find(|(known, _)| *known == offset).map_or("", |&(_, name)| name)
    }

    #[cold]
    fn check_ecc(&mut self, offset: usize) {
        self.units.flash.check_ecc(offset as u32 / 8);
    }

    /// Cycles for which the core waits for the bank that it has read from.
    #[cold]
    fn wait_for_bank(&self, now: Cycle) -> Option<u32> {
        self.stalls.set(false);
        let (_, until) = self.units.flash.busy()?;
        let free_at = self.clocks.base.cycle_at(until);
        Some(u32::try_from(free_at.saturating_sub(now)).unwrap_or(u32::MAX))
    }

    /// Makes a read or fetch from a busy bank wait until the bank is free.
    fn note_bank(&self, offset: usize) {
        if self
            .units
            .flash
            .busy()
            .is_some_and(|(bank, _)| usize::from(bank) == offset / (crate::memory::FLASH_SIZE / 2))
        {
            self.stalls.set(true);
        }
    }
}

impl<W: World> Chip<W> {
    /// Reads anything except SRAM at its own address.
    #[inline(never)]
    fn read_elsewhere(&mut self, now: Cycle, address: u32, access: Access) -> Result<u32, BusFault> {
        match Memory::place(address) {
            Some(Place::Flash(offset)) => {
                if !self.units.flash.is_calm() {
                    self.check_ecc(offset);
                    self.note_bank(offset);
                }
                self.memory.read_flash(offset, access).ok_or(BusFault)
            }
            Some(Place::Ram(offset)) => self.memory.read_ram(offset, access).ok_or(BusFault),
            Some(Place::System(address)) => {
                let word = self.memory.system_word(address, self.units.flash.options());
                Ok(narrow(word, address, access))
            }
            None => {
                self.advance_to(now);
                let value = self.read_register(address, access);
                self.serve_dma();
                value
            }
        }
    }

    #[inline(never)]
    fn write_elsewhere(&mut self, now: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault> {
        match Memory::place(address) {
            Some(Place::Ram(offset)) => self.memory.write_ram(offset, access, value).ok_or(BusFault),
            Some(Place::Flash(offset)) => {
                self.advance_to(now);
                // Without power nothing is written any more.
                if self.demand == Some(Demand::PowerLost) {
                    return Ok(());
                }
                let cells = self.memory.flash.get(offset & !7..(offset & !7) + 8);
                let cells = cells.and_then(|cells| cells.try_into().ok()).map_or(0, u64::from_le_bytes);
                let moment = Moment { now: self.now, clocks: &self.clocks };
                self.units.flash.program(moment, offset as u32, access, value, cells);
                self.react(Unit::Flash);
                Ok(())
            }
            Some(Place::System(_)) => Err(BusFault),
            None => {
                self.advance_to(now);
                if self.demand == Some(Demand::PowerLost) {
                    return Ok(());
                }
                let done = self.write_register(address, access, value);
                self.serve_dma();
                done
            }
        }
    }
}

impl<W: World> Bus for Chip<W> {
    #[inline(always)]
    fn read(&mut self, now: Cycle, address: u32, access: Access) -> Result<u32, BusFault> {
        match self.memory.read_ram(address.wrapping_sub(RAM_BASE) as usize, access) {
            Some(value) => Ok(value),
            None => self.read_elsewhere(now, address, access),
        }
    }

    #[inline(always)]
    fn write(&mut self, now: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault> {
        match self.memory.write_ram(address.wrapping_sub(RAM_BASE) as usize, access, value) {
            Some(()) => Ok(()),
            None => self.write_elsewhere(now, address, access, value),
        }
    }

    #[inline]
    fn fetch(&self, address: u32) -> Result<u16, BusFault> {
        if !self.units.flash.is_calm()
            && let Some(Place::Flash(offset)) = Memory::place(address)
        {
            self.note_bank(offset);
        }
        self.memory.fetch(address).ok_or(BusFault)
    }

    fn code_version(&self) -> u64 {
        self.code_version
    }

    #[inline]
    fn wait_states(&self, now: Cycle) -> u32 {
        if self.stalls.get()
            && let Some(wait) = self.wait_for_bank(now)
        {
            return wait;
        }
        // As if the instruction cache never hit: the worst case, see FIDELITY.
        self.units.flash.wait_states()
    }

    #[inline]
    fn advance(&mut self, now: Cycle) {
        self.advance_to(now);
    }

    #[inline]
    fn next_event(&self) -> Cycle {
        self.schedule.next()
    }

    #[inline]
    fn lines(&self) -> Lines {
        self.schedule.lines()
    }

    #[inline]
    fn nmi(&self) -> bool {
        self.units.flash.nmi()
    }

    #[inline]
    fn stop_requested(&self) -> bool {
        self.demand.is_some()
    }
}
