//! Core and chip together: the simulated board.

use vergence_cpu::{Cpu, Cycle, Stop};

use crate::chip::{Chip, ChipConfig};
use crate::firmware::{Firmware, FirmwareError};
use crate::halt::{Halt, Place};
use crate::memory::FLASH_BASE;
use crate::pages::PageUse;
use crate::rcc::ResetCause;
use crate::time::Picoseconds;
use crate::trouble::Demand;
use crate::world::World;

/// The events that a machine stops at. A board without debugger stops at none of these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stops {
    /// Stop at breakpoint instructions; otherwise they are faults.
    pub breakpoints: bool,
    /// Stop at lockup; otherwise time continues, and the watchdog may reset the chip.
    pub lockups: bool,
    /// Stop at flash operations, immediately after they began.
    pub flash_operations: bool,
}

/// A board. Clone it for a snapshot.
#[derive(Clone)]
pub struct Machine<W> {
    pub(crate) cpu: Cpu,
    pub(crate) chip: Chip<W>,
    firmware: Firmware,
    stops: Stops,
    pub(crate) skips_waiting: bool,
    /// The cause of the last reset, and the number of resets since power-on.
    reset: ResetCause,
    resets: u64,
    /// Place at which the core last locked up.
    lockup: Option<Place>,
    /// Whether the supply is too low: the chip is held in reset.
    pub(crate) in_brown_out: bool,
}

impl<W: World> Machine<W> {
    /// A board with erased flash at power-on.
    #[must_use]
    pub fn new(config: ChipConfig, world: W) -> Self {
        let mut machine = Self {
            cpu: Cpu::new(),
            chip: Chip::new(config, world),
            firmware: Firmware::default(),
            stops: Stops::default(),
            skips_waiting: false,
            reset: ResetCause::PowerOn,
            resets: 0,
            lockup: None,
            in_brown_out: false,
        };
        machine.cpu.reset(&mut machine.chip);
        machine
    }

    /// Loads firmware into flash and starts it as after power-on. The rest of flash is kept.
    ///
    /// # Errors
    /// [`FirmwareError::OutsideFlash`] where a segment lies outside flash.
    pub fn load(&mut self, firmware: Firmware) -> Result<(), FirmwareError> {
        for (address, bytes) in firmware.segments() {
            let offset = address.wrapping_sub(FLASH_BASE) as usize;
            if !self.chip.load_flash(offset, bytes) {
                return Err(FirmwareError::OutsideFlash { address, length: bytes.len() });
            }
        }
        self.firmware = firmware;
        self.power_on();
        Ok(())
    }

    /// Sets the events that the machine stops at.
    pub fn set_stops(&mut self, stops: Stops) {
        self.stops = stops;
        self.announce_flash();
    }

    /// Skips whole iterations of loops in which the core only waits for the flash. Instructions and cycles are counted
    /// as if they had run.
    pub fn set_skips_waiting(&mut self, skips: bool) {
        self.skips_waiting = skips;
        self.announce_flash();
    }

    /// Starts to record which pages of flash affect the run; call it right after power-on.
    pub fn track_pages(&mut self) {
        let pages = PageUse::default();
        // The reset has read the first vectors already.
        pages.note(0);
        self.chip.pages = Some(pages);
    }

    /// Pages of flash, by number, that were read, executed or programmed since [`Self::track_pages`] before they were
    /// erased: the contents of all other pages did not affect the run. Accesses by DMA are not recorded.
    #[must_use]
    pub fn pages_used(&self) -> Vec<usize> {
        self.chip.pages.as_ref().map(PageUse::pages).unwrap_or_default()
    }

    fn announce_flash(&mut self) {
        self.chip.units.flash.announces = self.skips_waiting || self.stops.flash_operations;
    }

    /// Switches the power off and on again.
    pub fn power_on(&mut self) {
        self.in_brown_out = false;
        self.restart(ResetCause::PowerOn);
        self.resets = 0;
    }

    /// Presses the reset button.
    pub fn press_reset(&mut self) {
        self.restart(ResetCause::Pin);
    }

    pub(crate) fn restart(&mut self, cause: ResetCause) {
        self.reset = cause;
        self.resets += 1;
        self.chip.reset(self.cpu.now(), cause);
        self.cpu.reset(&mut self.chip);
    }

    /// Runs until `time` since power-on, through resets. The last instruction may exceed it.
    pub fn run_until(&mut self, time: Picoseconds) -> Halt {
        if self.in_brown_out {
            return self.stand_until(time);
        }
        loop {
            // The core clock may have changed meanwhile.
            let end = self.chip.clocks.base.cycle_at(time);
            if self.cpu.now() >= end {
                return Halt::Reached;
            }
            let stop = self.run_some(end);
            if let Some(halt) = self.handle(stop) {
                return halt;
            }
        }
    }

    /// Runs to `end`, or to an earlier event that must be handled.
    fn run_some(&mut self, end: Cycle) -> Stop {
        if self.skips_waiting && self.chip.units.flash.running().is_some() {
            return self.run_beside_flash(end);
        }
        // Only accesses to peripherals interrupt the core, accesses to memory do not: run one instruction at a time.
        let end = if self.chip.units.flash.is_touchy() { self.cpu.now() + 1 } else { end };
        self.run_core(end)
    }

    /// Runs for a duration.
    pub fn run_for(&mut self, duration: Picoseconds) -> Halt {
        self.run_until(self.time() + duration)
    }

    fn handle(&mut self, stop: Stop) -> Option<Halt> {
        match stop {
            Stop::Reached => {}
            Stop::ResetRequested => self.restart(ResetCause::Software),
            Stop::Requested => return self.handle_demand(),
            Stop::Breakpoint(number) if self.stops.breakpoints => {
                return Some(Halt::Breakpoint { number, place: self.place() });
            }
            Stop::Breakpoint(_) => self.cpu.escalate_breakpoint(),
            Stop::Semihosting => return Some(Halt::Semihosting { place: self.place() }),
            Stop::Lockup => {
                let place = self.place();
                self.lockup = Some(place.clone());
                return self.stops.lockups.then_some(Halt::Lockup { place });
            }
            other => return Some(Halt::Other(format!("the core stopped: {other:?}"))),
        }
        None
    }

    pub(crate) fn handle_demand(&mut self) -> Option<Halt> {
        match self.chip.demand.take()? {
            Demand::FlashBegins => {
                let operation = self.chip.units.flash.running().filter(|_| self.stops.flash_operations);
                return operation.map(Halt::FlashOperation);
            }
            Demand::Watchdog => self.restart(ResetCause::Watchdog),
            Demand::OptionBytes => self.restart(ResetCause::OptionBytes),
            Demand::Trouble(trouble) => return Some(Halt::Trouble { trouble, place: self.place() }),
            Demand::PowerLost => {
                let place = self.place();
                self.power_on();
                return Some(Halt::PowerLost { place });
            }
        }
        None
    }

    /// The place and time at which the core is.
    #[must_use]
    pub fn place(&self) -> Place {
        let pc = self.cpu.pc();
        Place { pc, symbol: self.firmware.symbol_at(pc), time: self.time() }
    }

    /// Real time since power-on of the simulation; resets and power cuts do not set it back.
    #[must_use]
    pub fn time(&self) -> Picoseconds {
        self.chip.clocks.base.time_of(self.cpu.now())
    }

    /// The cause of the last reset.
    #[must_use]
    pub fn last_reset(&self) -> ResetCause {
        self.reset
    }

    /// Number of resets since power-on.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Place at which the core last locked up, if it ever did.
    #[must_use]
    pub fn last_lockup(&self) -> Option<&Place> {
        self.lockup.as_ref()
    }

    /// The core.
    #[must_use]
    pub fn cpu(&self) -> &Cpu {
        &self.cpu
    }

    /// Starts to time exception handlers; [`Cpu::handler_time`] returns the times.
    pub fn time_handlers(&mut self) {
        self.cpu.time_handlers();
    }

    /// The chip.
    #[must_use]
    pub fn chip(&self) -> &Chip<W> {
        &self.chip
    }

    /// The chip, to change it. Pins and serial lines change at the present instant.
    pub fn chip_mut(&mut self) -> &mut Chip<W> {
        self.chip.advance_to(self.cpu.now());
        &mut self.chip
    }

    /// The firmware, with its symbols.
    #[must_use]
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }
}
