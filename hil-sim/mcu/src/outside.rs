//! The chip from outside: access as of a debugger, a logic analyser and a serial peer.

use crate::census::Touched;
use crate::chip::Chip;
use crate::clocks::ClockTree;
use crate::flash_cells::FlashCells;
use crate::pin::Pin;
use crate::power_cut::PowerCut;
use crate::time::Picoseconds;
use crate::trouble::{Demand, Trouble};
use crate::uart::{Frame, SentByte};
use crate::unit::{UNITS, UartId, Unit};
use crate::vcd::Trace;
use crate::world::{Terminals, World};

impl<W: World> Chip<W> {
    /// Accesses that the model does not implement, where the chip is not strict; the first 64.
    #[must_use]
    pub fn troubles(&self) -> &[Trouble] {
        &self.troubles
    }

    /// The access at which a strict chip has stopped.
    #[must_use]
    pub fn complaint(&self) -> Option<&Trouble> {
        match &self.demand {
            Some(Demand::Trouble(trouble)) => Some(trouble),
            _ => None,
        }
    }

    /// Whether the watchdog has asked for a reset that has not happened yet.
    #[must_use]
    pub fn watchdog_bites(&self) -> bool {
        self.demand == Some(Demand::Watchdog)
    }

    /// Whether the power was cut and has not returned yet.
    #[must_use]
    pub fn power_is_lost(&self) -> bool {
        self.demand == Some(Demand::PowerLost)
    }

    /// Registers that the firmware has read or written.
    #[must_use]
    pub fn touched(&mut self) -> Vec<Touched> {
        let names: Vec<_> = (0..UNITS).map(|index| self.units.get(Unit::at(index)).registers()).collect();
        self.census.touched(|unit, offset| {
            names[unit.index()].iter().find(|(known, _)| *known == offset).map(|&(_, name)| name)
        })
    }

    /// The present clock frequencies.
    #[must_use]
    pub fn clock_tree(&self) -> ClockTree {
        self.clocks.tree
    }

    /// Real time at the last event.
    #[must_use]
    pub fn time(&self) -> Picoseconds {
        self.instant().time
    }

    /// The world around the chip.
    #[must_use]
    pub fn world(&self) -> &W {
        &self.world
    }

    /// Does something to the world, which may then do something to the chip.
    pub fn with_world<R>(&mut self, act: impl FnOnce(&mut W, &mut Terminals) -> R) -> R {
        let result = act(&mut self.world, &mut self.terminals);
        self.world_was_told();
        result
    }

    /// Takes the bytes that a serial port has sent since the last call.
    pub fn take_sent(&mut self, port: UartId) -> Vec<SentByte> {
        std::mem::take(&mut self.sent[port.index()])
    }

    /// Sends `frames` to a serial port, one after the other.
    pub fn send(&mut self, port: UartId, frames: &[Frame]) {
        self.terminals.frames.extend(frames.iter().map(|&frame| (port, frame)));
        self.connect_terminals();
        self.serve_dma();
    }

    /// Whether everything sent to a serial port has arrived.
    #[must_use]
    pub fn is_line_quiet(&self, port: UartId) -> bool {
        self.units.uarts[port.index()].is_line_quiet()
    }

    /// Contents of flash, 512 KiB from `0x0800_0000`.
    #[must_use]
    pub fn flash(&self) -> &[u8] {
        &self.memory.flash
    }

    /// Writes flash as a debugger does, without time or errors. Returns whether it fits.
    pub fn load_flash(&mut self, offset: usize, bytes: &[u8]) -> bool {
        let Some(place) = self.memory.flash.get_mut(offset..offset.saturating_add(bytes.len())) else { return false };
        place.copy_from_slice(bytes);
        let words = (offset / 8) as u32..=((offset + bytes.len()) / 8) as u32;
        self.units.flash.torn.retain(|word| !words.contains(word));
        self.code_version += 1;
        true
    }

    /// The contents that persist without power.
    #[must_use]
    pub fn flash_cells(&self) -> FlashCells {
        FlashCells::new(&self.memory.flash, &self.units.flash.torn)
    }

    /// Replaces the persistent contents by those of another chip.
    pub fn set_flash_cells(&mut self, cells: &FlashCells) {
        self.memory.flash.copy_from_slice(cells.bytes());
        self.units.flash.torn.clone_from(cells.torn());
        self.code_version += 1;
    }

    /// Contents of the SRAMs, 128 KiB from `0x2000_0000`: SRAM1, SRAM2, CCM.
    #[must_use]
    pub fn ram(&self) -> &[u8] {
        &self.memory.ram
    }

    /// The SRAMs, as a debugger writes them.
    pub fn ram_mut(&mut self) -> &mut [u8] {
        &mut self.memory.ram
    }

    /// Erasures and double words programmed since the chip was made.
    #[must_use]
    pub fn flash_operations(&self) -> u64 {
        self.units.flash.operations
    }

    /// Double words of flash that ECC cannot correct, by offset.
    pub fn torn_words(&self) -> impl Iterator<Item = usize> {
        self.units.flash.torn.iter().map(|&word| word as usize * 8)
    }

    /// Starts to trace pins; an earlier trace is dropped.
    pub fn trace(&mut self, pins: &[Pin]) {
        let levels = pins.iter().map(|&pin| (pin, self.is_high(pin))).collect();
        self.trace = Trace::new(levels);
        self.settle_everything();
    }

    /// The traced pins as a value change dump, under the names that `name` gives them.
    #[must_use]
    pub fn vcd(&self, name: impl Fn(Pin) -> String) -> String {
        self.trace.dump(name)
    }

    /// Orders a power cut, or cancels it.
    pub fn set_power_cut(&mut self, cut: Option<PowerCut>) {
        self.units.flash.cut = cut;
    }
}
