//! The chip: memories and peripherals behind the core's bus, and the world around it.

use std::cell::Cell;

use vergence_cpu::{Cycle, NEVER};

use crate::census::Census;
use crate::clocks::{ClockTree, Clocks, VoltageRange, check_core_clock, check_step};
use crate::directory::Directory;
use crate::memory::Memory;
use crate::pads::Pads;
use crate::pages::PageUse;
use crate::peripheral::{Moment, Refused, Reply};
use crate::rcc::ResetCause;
use crate::schedule::{Due, Schedule};
use crate::service::RequestSources;
use crate::time::{Picoseconds, TimeBase};
use crate::trouble::{Demand, Trouble};
use crate::uart::SentByte;
use crate::unit::{UNITS, UartId, Unit};
use crate::units::Units;
use crate::vcd::Trace;
use crate::world::{Instant, Terminals, World};

/// Properties of a chip, and how strict its model is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipConfig {
    /// The unique device identifier.
    pub uid: [u32; 3],
    /// Seed of the RAM contents at power-on and of the random number generator.
    pub seed: u64,
    /// Stop at accesses that the model does not implement. Otherwise they are recorded, reads give zero and writes are
    /// lost.
    pub strict: bool,
    /// Admit a core clock that is too fast for its supply or wait states: it is recorded, and the chip continues.
    pub overclock: bool,
}

impl Default for ChipConfig {
    fn default() -> Self {
        Self { uid: [0x0031_0042, 0x3238_510A, 0x2038_3753], seed: 1, strict: true, overclock: false }
    }
}

/// Number of troubles recorded where the chip is not strict.
const TROUBLES_KEPT: usize = 64;
/// Number of events at one instant that counts as an endless loop.
const EVENTS_AT_ONCE: u32 = 100_000;

/// An STM32G474RE wired to a world. Clone it for a snapshot.
#[derive(Clone, Debug)]
pub struct Chip<W> {
    config: ChipConfig,
    pub(crate) memory: Memory,
    pub(crate) units: Units,
    pub(crate) clocks: Clocks,
    pub(crate) pads: Pads,
    pub(crate) schedule: Schedule,
    pub(crate) sources: RequestSources,
    pub(crate) directory: Directory,
    /// A bit for each peripheral whose clock runs.
    pub(crate) clocked: u64,
    /// Whether something has happened that may request DMA.
    pub(crate) stirred: bool,
    pub(crate) census: Census,
    pub(crate) world: W,
    pub(crate) terminals: Terminals,
    pub(crate) trace: Trace,
    pub(crate) now: Cycle,
    pub(crate) code_version: u64,
    pub(crate) demand: Option<Demand>,
    /// Whether code was fetched from a busy bank of flash: the next branch waits for it.
    pub(crate) stalls: Cell<bool>,
    /// The pages of flash used, where that is tracked.
    pub(crate) pages: Option<PageUse>,
    pub(crate) troubles: Vec<Trouble>,
    pub(crate) sent: Vec<Vec<SentByte>>,
    power_cycles: u64,
    /// The core clock, supply and wait states that were checked last.
    speed: Option<(u32, VoltageRange, u32)>,
    /// When the core clock last changed.
    stepped_at: Picoseconds,
}

impl<W: World> Chip<W> {
    /// A chip with erased flash at power-on.
    #[must_use]
    pub fn new(config: ChipConfig, world: W) -> Self {
        let mut units = Units::new(config.seed);
        let directory = Directory::new(&mut units);
        let tree = units.rcc.tree();
        let mut chip = Self {
            config,
            memory: Memory::new(config.uid, config.seed),
            clocks: Clocks { base: TimeBase::new(tree.hclk), tree },
            units,
            pads: Pads::new(),
            schedule: Schedule::new(),
            sources: RequestSources::new(),
            directory,
            clocked: 0,
            stirred: true,
            census: Census::new(),
            world,
            terminals: Terminals::default(),
            trace: Trace::default(),
            now: 0,
            code_version: 0,
            demand: None,
            stalls: Cell::new(false),
            pages: None,
            troubles: Vec::new(),
            sent: vec![Vec::new(); UartId::COUNT],
            power_cycles: 0,
            speed: None,
            stepped_at: Picoseconds(0),
        };
        chip.settle_everything();
        chip
    }

    /// Resets everything except the contents of memory; power-on also loses RAM.
    pub fn reset(&mut self, now: Cycle, cause: ResetCause) {
        self.advance_to(now);
        self.demand = None;
        self.units.reset(cause);
        if cause.is_of_power() {
            self.power_cycles += 1;
            self.memory.lose_power(self.config.seed ^ self.power_cycles << 32);
        }
        self.code_version += 1;
        let tree = self.units.rcc.tree();
        self.clocks.base.change(now, tree.hclk);
        self.clocks.tree = tree;
        self.settle_everything();
    }

    /// Determines the state of all peripherals anew.
    pub(crate) fn settle_everything(&mut self) {
        self.pads.watched = self.world.watched().iter().fold(self.trace.watched(), |all, pin| all | pin.set());
        for port in 0..self.units.ports.len() {
            self.units.ports[port].changed = true;
            self.react(Unit::Gpio(port as u8));
        }
        self.watch_timers();
        self.find_clocked();
        self.stirred = true;
        for index in 0..UNITS {
            self.refresh(Unit::at(index));
        }
        self.refresh_world();
    }

    pub(crate) fn find_clocked(&mut self) {
        let clocked = |index: &usize| self.units.rcc.is_clocked(Unit::at(*index));
        self.clocked = (0..UNITS).filter(clocked).fold(0, |all, index| all | 1 << index);
    }

    pub(crate) fn instant(&self) -> Instant {
        Instant { cycle: self.now, time: self.clocks.base.time_of(self.now) }
    }

    /// Processes all events that are due up to `now`, each at its own instant.
    #[inline]
    pub(crate) fn advance_to(&mut self, now: Cycle) {
        if self.schedule.next() <= now {
            self.run_events(now);
        }
        self.now = self.now.max(now);
    }

    fn run_events(&mut self, now: Cycle) {
        let (mut last, mut at_once) = (0, 0);
        while let Some((at, due)) = self.schedule.first_until(now) {
            at_once = if at == last { at_once + 1 } else { 0 };
            last = at;
            self.now = self.now.max(at);
            if at_once > EVENTS_AT_ONCE {
                self.break_loop(due);
                continue;
            }
            match due {
                Due::World => self.run_world(),
                Due::Unit(unit) => {
                    let moment = Moment { now: self.now, clocks: &self.clocks };
                    self.units.get(unit).advance(moment);
                    self.react(unit);
                    self.serve_dma();
                }
            }
        }
    }

    fn break_loop(&mut self, due: Due) {
        let unit = match due {
            Due::World => {
                self.schedule.set_world(NEVER);
                "the world".to_owned()
            }
            Due::Unit(unit) => {
                self.schedule.set(unit, NEVER, self.units.get(unit).lines());
                unit.to_string()
            }
        };
        self.complain(Trouble::Endless { at: self.now, unit });
    }

    /// Determines when a peripheral is due and which lines it asserts.
    pub(crate) fn refresh(&mut self, unit: Unit) {
        let peripheral = self.units.get(unit);
        let (due, lines) = (peripheral.due(&self.clocks), peripheral.lines());
        self.schedule.set(unit, due, lines);
    }

    fn refresh_world(&mut self) {
        self.schedule.set_world(self.clocks.base.cycle_at(self.world.next_event()));
    }

    fn run_world(&mut self) {
        let now = self.instant();
        self.world.act(now, &mut self.terminals);
        self.connect_terminals();
        self.serve_dma();
        self.refresh_world();
    }

    /// Applies what the world did in answer to an event.
    pub(crate) fn world_was_told(&mut self) {
        self.connect_terminals();
        self.refresh_world();
    }

    /// Takes over a changed clock tree: advances everything to now by the old clocks, then continues with the new ones.
    pub(crate) fn reclock(&mut self) {
        let tree = self.units.rcc.tree();
        if tree != self.clocks.tree {
            let moment = Moment { now: self.now, clocks: &self.clocks };
            for index in 0..UNITS {
                self.units.get(Unit::at(index)).advance(moment);
            }
            self.check_step(&tree);
            self.clocks.base.change(self.now, tree.hclk);
            self.clocks.tree = tree;
            let moment = Moment { now: self.now, clocks: &self.clocks };
            self.units.timers.iter_mut().for_each(|timer| timer.set_divider(moment, &tree));
            (0..UNITS).for_each(|index| self.refresh(Unit::at(index)));
            self.refresh_world();
            self.stirred = true;
        }
        self.check_speed();
    }

    fn check_speed(&mut self) {
        let speed = (self.clocks.tree.hclk, self.units.pwr.range(), self.units.flash.wait_states());
        if self.speed == Some(speed) {
            return;
        }
        self.speed = Some(speed);
        let (hclk, range, wait_states) = speed;
        self.judge_clocks(check_core_clock(hclk, range, wait_states));
    }

    fn check_step(&mut self, after: &ClockTree) {
        let (before, now) = (self.clocks.tree, self.clocks.base.time_of(self.now));
        self.judge_clocks(check_step(&before, after, now - self.stepped_at));
        if (before.hclk, before.from_pll) != (after.hclk, after.from_pll) {
            self.stepped_at = now;
        }
    }

    fn judge_clocks(&mut self, verdict: Reply<()>) {
        match verdict {
            Err(Refused(what)) if self.config.overclock => self.note(Trouble::Clocks { what }),
            Err(Refused(what)) => self.complain(Trouble::Clocks { what }),
            Ok(()) => {}
        }
    }

    /// Reports trouble: a strict chip stops, another one records it.
    pub(crate) fn complain(&mut self, trouble: Trouble) {
        if self.config.strict {
            self.ask(Demand::Trouble(trouble));
        } else {
            self.note(trouble);
        }
    }

    fn note(&mut self, trouble: Trouble) {
        if self.troubles.len() < TROUBLES_KEPT && !self.troubles.contains(&trouble) {
            self.troubles.push(trouble);
        }
    }

    pub(crate) fn ask(&mut self, demand: Demand) {
        self.demand.get_or_insert(demand);
    }

    pub(crate) fn note_sent(&mut self, port: UartId, byte: SentByte) {
        self.sent[port.index()].push(byte);
    }
}
