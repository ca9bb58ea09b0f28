//! The core as its user sees it: reset, run, registers, reasons to stop.

use crate::bus::{Bus, Cycle, NEVER};
use crate::cache::{Cache, Entries};
use crate::decode;
use crate::execute::Trap;
use crate::handlers::{HandlerTime, HandlerTimes};
use crate::instruction::{Instruction, Op};
use crate::nvic::{Nvic, exception};
use crate::system::{System, sleep};
use crate::systick::SysTick;

/// Why [`Cpu::run`] returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The clock reached the cycle asked for.
    Reached,
    /// A BKPT instruction with this number; the PC still points to it. [`Cpu::escalate_breakpoint`] continues as a chip
    /// without a debugger does.
    Breakpoint(u8),
    /// A semihosting call (BKPT 0xAB): operation in R0, argument in R1, result expected in R0. The PC is past it.
    Semihosting,
    /// A fault in a handler that nothing can preempt. From here [`Cpu::run`] only lets time pass, until
    /// [`Cpu::reset`].
    Lockup,
    /// The program asked for a reset (AIRCR.SYSRESETREQ). From here [`Cpu::run`] only lets time pass, until
    /// [`Cpu::reset`].
    ResetRequested,
    /// The core sleeps and neither it nor the chip has anything that could ever wake it.
    Asleep,
    /// The chip asked to stop, see [`Bus::stop_requested`].
    Requested,
}

/// The event that the core waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Activity {
    Running,
    /// WFI, or sleep on exit.
    AwaitingInterrupt,
    /// WFE.
    AwaitingEvent,
    /// Locked up, or waiting for the reset it asked for.
    Halted,
}

/// A Cortex-M4F. Clone it for a snapshot; the chip must be cloned at the same moment.
#[derive(Clone)]
pub struct Cpu {
    /// R0 to R14; R15 holds the PC as the running instruction reads it, its address plus four.
    pub(crate) r: [u32; 16],
    /// Address of the next instruction.
    pub(crate) pc: u32,
    /// The stack pointer that is not selected.
    pub(crate) other_stack: u32,
    pub(crate) n: bool,
    pub(crate) z: bool,
    pub(crate) c: bool,
    pub(crate) v: bool,
    pub(crate) q: bool,
    /// GE flags, one per byte lane.
    pub(crate) ge: u8,
    /// ITSTATE.
    pub(crate) it: u8,
    pub(crate) thumb: bool,
    /// IPSR: the exception that runs, 0 in thread mode.
    pub(crate) exception: u16,
    pub(crate) primask: bool,
    pub(crate) faultmask: bool,
    pub(crate) basepri: u8,
    pub(crate) unprivileged: bool,
    /// CONTROL.SPSEL: thread mode uses the process stack.
    pub(crate) process_stack: bool,
    /// CONTROL.FPCA: the context has floating-point state.
    pub(crate) float_active: bool,
    /// Whether floating-point instructions may run without another check.
    pub(crate) float_ready: bool,
    pub(crate) s: [u32; 32],
    pub(crate) fpscr: u32,
    pub(crate) exclusive: bool,
    pub(crate) event: bool,
    pub(crate) activity: Activity,
    pub(crate) stop: Option<Stop>,
    pub(crate) nvic: Nvic,
    pub(crate) system: System,
    pub(crate) systick: SysTick,
    pub(crate) now: Cycle,
    /// Instructions run without checks up to this cycle; whatever may change what comes next sets it to zero.
    pub(crate) horizon: Cycle,
    /// Whether the previous instruction was a load: the next one is pipelined with it.
    pub(crate) loaded: bool,
    pub(crate) instructions: u64,
    asleep: Cycle,
    pub(crate) handlers: Option<Box<HandlerTimes>>,
    cache: Cache,
    pub(crate) code_version: u64,
}

impl Default for Cpu {
    fn default() -> Self {
        Self::new()
    }
}

impl Cpu {
    /// A core at power-on, cycle 0; it needs a [`reset`](Self::reset) to find its program.
    #[must_use]
    pub fn new() -> Self {
        Self {
            r: [0; 16],
            pc: 0,
            other_stack: 0,
            n: false,
            z: false,
            c: false,
            v: false,
            q: false,
            ge: 0,
            it: 0,
            thumb: true,
            exception: 0,
            primask: false,
            faultmask: false,
            basepri: 0,
            unprivileged: false,
            process_stack: false,
            float_active: false,
            float_ready: false,
            s: [0; 32],
            fpscr: 0,
            exclusive: false,
            event: false,
            activity: Activity::Running,
            stop: None,
            nvic: Nvic::new(),
            system: System::new(),
            systick: SysTick::new(),
            now: 0,
            horizon: 0,
            loaded: false,
            instructions: 0,
            asleep: 0,
            handlers: None,
            cache: Cache::new(),
            code_version: 0,
        }
    }

    /// Resets the core: stack pointer and PC from the vector table at address 0. The clock continues. Core registers
    /// other than SP, LR and PC, which are unknown after a real reset, become zero.
    pub fn reset<B: Bus>(&mut self, bus: &mut B) {
        let handlers = self.handlers.take().map(|_| Box::new(HandlerTimes::new()));
        let (now, instructions, asleep) = (self.now, self.instructions, self.asleep);
        let mut fresh = Self { now, instructions, asleep, handlers, ..Self::new() };
        fresh.system.set_cycle_counter(fresh.now, 0);
        fresh.systick.advance(fresh.now);
        fresh.code_version = bus.code_version();
        *self = fresh;
        self.r[14] = u32::MAX;
        let vectors = (self.load_vector(bus, 0), self.load_vector(bus, 4));
        if let (Ok(stack), Ok(entry)) = vectors {
            self.r[13] = stack & !3;
            self.pc = entry & !1;
            self.thumb = entry & 1 != 0;
        } else {
            self.halt(Stop::Lockup);
        }
    }

    /// Runs to the first instruction boundary at or after `until`, or until there is a reason to stop earlier. The time
    /// of one instruction or exception entry may exceed `until`.
    pub fn run<B: Bus>(&mut self, bus: &mut B, until: Cycle) -> Stop {
        loop {
            if let Some(stop) = self.settle(bus) {
                return stop;
            }
            if self.now >= until {
                return Stop::Reached;
            }
            if self.activity != Activity::Running {
                if let Some(stop) = self.pass_time(bus, until) {
                    return stop;
                }
                continue;
            }
            self.horizon = until.min(bus.next_event()).min(self.systick.next_event());
            if self.horizon <= self.now {
                // An event stays due: one instruction at a time.
                self.horizon = self.now + 1;
            }
            self.run_to_horizon(bus);
        }
    }

    fn run_to_horizon<B: Bus>(&mut self, bus: &mut B) {
        let mut decoded = self.cache.lend();
        let ended = self.run_decoded(bus, &mut decoded);
        self.cache.take_back(decoded);
        if let Err(trap) = ended {
            self.trapped(bus, trap);
        }
    }

    fn run_decoded<B: Bus>(&mut self, bus: &mut B, decoded: &mut Entries) -> Result<(), Trap> {
        while self.now < self.horizon {
            let pc = self.pc;
            self.r[15] = pc.wrapping_add(4);
            let generation = self.cache.generation();
            let instruction = match decoded.get(pc, generation) {
                Some(instruction) => instruction,
                None => decoded.insert(pc, generation, self.decode(bus, pc)?),
            };
            self.pc = pc.wrapping_add(instruction.length());
            self.now = self.now.wrapping_add(1);
            self.instructions = self.instructions.wrapping_add(1);
            if self.it == 0 {
                self.execute(bus, instruction)?;
            } else {
                self.execute_in_it_block(bus, *instruction)?;
            }
        }
        Ok(())
    }

    /// Advances chip and core to the same cycle and takes the exception that is due.
    fn settle<B: Bus>(&mut self, bus: &mut B) -> Option<Stop> {
        self.synchronize(bus);
        if bus.stop_requested() {
            return Some(Stop::Requested);
        }
        if self.stop.is_some() {
            return self.stop.take();
        }
        if self.activity == Activity::Halted {
            return None;
        }
        self.wake();
        self.take_pending(bus);
        if !self.thumb && self.activity == Activity::Running {
            self.r[15] = self.pc.wrapping_add(4);
            self.trapped(bus, Trap::InvalidState);
            self.take_pending(bus);
        }
        self.stop.take()
    }

    /// Advances the chip and SysTick to now, records what they pend, and drops decoded code that has changed. Events
    /// that came due meanwhile happen one by one, so that a pulse shorter than an instruction is noticed.
    pub(crate) fn synchronize<B: Bus>(&mut self, bus: &mut B) {
        let mut due = bus.next_event();
        while due < self.now {
            bus.advance(due);
            self.observe(bus);
            let next = bus.next_event();
            if next <= due {
                break;
            }
            due = next;
        }
        bus.advance(self.now);
        self.observe(bus);
        if self.systick.next_event() <= self.now && self.systick.advance(self.now) {
            self.nvic.raise(exception::SYSTEM_TICK);
            self.pended();
        }
        let version = bus.code_version();
        if version != self.code_version {
            self.code_version = version;
            self.cache.clear();
        }
    }

    fn observe<B: Bus>(&mut self, bus: &B) {
        if self.nvic.observe(bus.lines(), bus.nmi()) {
            self.pended();
        }
    }

    /// A new pending exception is an event where SCR.SEVONPEND says so.
    pub(crate) fn pended(&mut self) {
        if self.system.sleep & sleep::EVENT_ON_PENDING != 0 {
            self.event = true;
        }
    }

    /// Sleeps until the next event that is possible.
    fn pass_time<B: Bus>(&mut self, bus: &mut B, until: Cycle) -> Option<Stop> {
        let next = until.min(bus.next_event()).min(self.systick.next_event());
        if next == NEVER {
            return Some(Stop::Asleep);
        }
        let next = next.max(self.now + 1);
        self.asleep += next - self.now;
        self.now = next;
        None
    }

    pub(crate) fn halt(&mut self, stop: Stop) {
        self.activity = Activity::Halted;
        self.stop = Some(stop);
        self.horizon = 0;
    }

    /// An instruction whose condition fails takes its cycle and does nothing (A7.3).
    #[inline(never)]
    fn execute_in_it_block<B: Bus>(&mut self, bus: &mut B, mut instruction: Instruction) -> Result<(), Trap> {
        let state = self.it;
        self.it = if state & 7 == 0 { 0 } else { state & 0xe0 | state << 1 & 0x1f };
        // A breakpoint ignores the condition.
        if !self.condition(state >> 4) && instruction.op != Op::Breakpoint {
            return Ok(());
        }
        instruction.flags = instruction.flags.inside_it();
        self.execute(bus, &instruction).inspect_err(|trap| {
            if trap.repeats() {
                self.it = state;
            }
        })
    }

    #[cold]
    fn decode<B: Bus>(&mut self, bus: &B, pc: u32) -> Result<Instruction, Trap> {
        const DEVICES: std::ops::Range<u32> = 0x4000_0000..0x6000_0000;
        const EXTERNAL_DEVICES: u32 = 0xa000_0000;
        if DEVICES.contains(&pc) || pc >= EXTERNAL_DEVICES {
            return Err(Trap::ExecuteNever);
        }
        let first = bus.fetch(pc).map_err(|_| Trap::InstructionBus)?;
        let instruction = if decode::is_wide(first) {
            let second = bus.fetch(pc.wrapping_add(2)).map_err(|_| Trap::InstructionBus)?;
            decode::wide(first, second)
        } else {
            decode::narrow(first)
        };
        self.cache.mark(pc);
        Ok(instruction)
    }

    /// Reports a store to the table of decoded instructions.
    #[inline(always)]
    pub(crate) fn code_written(&mut self, address: u32) {
        if self.cache.written(address) {
            self.horizon = 0;
        }
    }

    /// Cycles since power-on.
    #[must_use]
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// Instructions executed since power-on.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.instructions
    }

    /// Cycles since power-on in which the core slept or stood still.
    #[must_use]
    pub fn asleep(&self) -> Cycle {
        self.asleep
    }

    /// Starts timing exception handlers; a reset starts the times anew.
    pub fn time_handlers(&mut self) {
        self.handlers = Some(Box::new(HandlerTimes::new()));
    }

    /// The time that the handler of an exception (16 and up: interrupt lines) took since [`Self::time_handlers`].
    #[must_use]
    pub fn handler_time(&self, exception: u16) -> HandlerTime {
        self.handlers.as_ref().map_or_else(HandlerTime::default, |handlers| handlers.of(exception))
    }

    /// Whether the core sleeps (WFI, WFE or sleep on exit).
    #[must_use]
    pub fn is_asleep(&self) -> bool {
        matches!(self.activity, Activity::AwaitingInterrupt | Activity::AwaitingEvent)
    }
}
