//! Running the core while the flash is busy or has torn words.

use vergence_cpu::{Access, Bus, BusFault, CoreState, Cycle, Lines, Stop};

use crate::chip::Chip;
use crate::machine::Machine;
use crate::memory::{Memory, Place};
use crate::world::World;

/// FLASH_SR, which a loop that waits for the flash reads.
const FLASH_SR: u32 = 0x4002_2010;
/// The longest loop that is searched for, in instructions.
const LONGEST: usize = 12;
/// The way to such a loop, out of and into functions, is shorter than this; an interrupt may be longer.
const PATIENCE: usize = 400;
/// Cycles after which a loop is searched for again, where none was found.
const AGAIN: Cycle = 2_000;

impl<W: World> Machine<W> {
    /// Runs to `end` or a reason to stop. Where words are torn, the core checks after each load.
    pub(crate) fn run_core(&mut self, end: Cycle) -> Stop {
        if self.chip.units.flash.torn.is_empty() && self.chip.pages.is_none() {
            self.cpu.run(&mut self.chip, end)
        } else {
            self.cpu.run(&mut Watched { chip: &mut self.chip, disturbed: false }, end)
        }
    }

    /// Runs at most to `end`; whole iterations of a loop that only polls whether the flash is busy are skipped up to
    /// the next event.
    pub(crate) fn run_beside_flash(&mut self, end: Cycle) -> Stop {
        let (cycles, instructions) = match self.find_loop(end) {
            Err(stop) => return stop,
            Ok(None) => return self.run_core(end.min(self.cpu.now() + AGAIN)),
            Ok(Some(turn)) => turn,
        };
        let due = end.min(self.chip.next_event()).min(self.cpu.next_event());
        // The last iteration before an event is run, so that the event is noticed at the same instruction as otherwise.
        let turns = (due.saturating_sub(self.cpu.now()) / cycles).saturating_sub(1);
        self.cpu.pass_turns(turns * cycles, turns * instructions);
        self.run_core(end.min(due.max(self.cpu.now()) + 1))
    }

    /// Runs instruction by instruction. Returns the cycles and instructions of an iteration once two iterations of a
    /// loop have changed nothing: the same registers after each instruction of both, no store, and no peripheral
    /// register read except the one that shows whether the flash is busy.
    fn find_loop(&mut self, end: Cycle) -> Result<Option<(Cycle, u64)>, Stop> {
        let mut seen: Vec<(CoreState, Cycle)> = Vec::with_capacity(3 * LONGEST);
        let mut bus = Watched { chip: &mut self.chip, disturbed: false };
        for _ in 0..PATIENCE {
            if bus.chip.units.flash.running().is_none() || self.cpu.now() >= end {
                break;
            }
            if seen.len() == 3 * LONGEST {
                seen.drain(..LONGEST);
            }
            seen.push((self.cpu.state(), self.cpu.now()));
            if let Some(turn) = turn(&seen) {
                return Ok(Some(turn));
            }
            let stop = self.cpu.run(&mut bus, self.cpu.now() + 1);
            if stop != Stop::Reached {
                return Err(stop);
            }
            if std::mem::take(&mut bus.disturbed) {
                seen.clear();
            }
        }
        Ok(None)
    }
}

/// Cycles and instructions of an iteration, if the last states are two equal iterations.
fn turn(seen: &[(CoreState, Cycle)]) -> Option<(Cycle, u64)> {
    let last = seen.len().checked_sub(1)?;
    let length = (1..=LONGEST.min(last / 2)).find(|length| seen[last - length].0.pc() == seen[last].0.pc())?;
    let same = (0..=length).all(|back| seen[last - back].0 == seen[last - length - back].0);
    let [now, before, first] = [0, length, 2 * length].map(|back| seen[last - back].1);
    (same && now - before == before - first).then_some((now - before, length as u64))
}

/// The chip, for a core that checks after each load. It records whether anything except the flash status was read or
/// written outside plain memory, and which pages of flash were used.
struct Watched<'a, W> {
    chip: &'a mut Chip<W>,
    disturbed: bool,
}

impl<W> Watched<'_, W> {
    #[inline]
    fn note(&self, address: u32) {
        if let (Some(pages), Some(Place::Flash(offset))) = (&self.chip.pages, Memory::place(address)) {
            pages.note(offset);
        }
    }
}

impl<W: World> Bus for Watched<'_, W> {
    const READS_INTERRUPT: bool = true;

    #[inline]
    fn read(&mut self, now: Cycle, address: u32, access: Access) -> Result<u32, BusFault> {
        match (Memory::place(address), &self.chip.pages) {
            (Some(Place::Flash(offset)), Some(pages)) => pages.note(offset),
            (None, _) => self.disturbed |= address != FLASH_SR,
            _ => {}
        }
        self.chip.read(now, address, access)
    }

    #[inline]
    fn write(&mut self, now: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault> {
        self.disturbed = true;
        self.note(address);
        self.chip.write(now, address, access, value)
    }

    fn fetch(&self, address: u32) -> Result<u16, BusFault> {
        self.note(address);
        self.chip.fetch(address)
    }

    #[inline]
    fn code_version(&self) -> u64 {
        self.chip.code_version()
    }

    #[inline]
    fn wait_states(&self, now: Cycle) -> u32 {
        self.chip.wait_states(now)
    }

    fn advance(&mut self, now: Cycle) {
        self.chip.advance(now);
    }

    #[inline]
    fn next_event(&self) -> Cycle {
        self.chip.next_event()
    }

    #[inline]
    fn lines(&self) -> Lines {
        self.chip.lines()
    }

    #[inline]
    fn nmi(&self) -> bool {
        self.chip.nmi()
    }

    #[inline]
    fn stop_requested(&self) -> bool {
        self.chip.stop_requested()
    }
}
