//! Exception entry and return, stacking, tail chaining, late arrival and sleep (B1.5.5 to B1.5.8, B1.5.18).

use crate::bus::{Access, Bus, Cycle};
use crate::cpu::{Activity, Cpu, Stop};
use crate::execute::Trap;
use crate::nvic::{HARD_FAULT_PRIORITY, THREAD_PRIORITY, exception};
use crate::system::{configuration, context, sleep, status};

const BASIC_FRAME: u32 = 0x20;
const FLOAT_FRAME: u32 = 0x68;
/// Bits of EXC_RETURN.
const RETURN_PREFIX: u32 = 0xffff_ffe1;
const RETURN_BASIC_FRAME: u32 = 1 << 4;
const RETURN_THREAD: u32 = 1 << 3;
const RETURN_PROCESS: u32 = 1 << 2;
/// Bit 9 of a stacked xPSR: the stack was padded to a multiple of eight.
const PADDED: u32 = 1 << 9;

/// Cortex-M4 TRM 3.9: cycles from interrupt to handler, from handler to what it interrupted, from handler to handler,
/// and what storing the floating-point registers adds.
const ENTRY_CYCLES: u64 = 12;
const RETURN_CYCLES: u64 = 10;
const TAIL_CHAIN_CYCLES: u64 = 6;
const FLOAT_STORE_CYCLES: u64 = 17;

impl Cpu {
    /// The priority that a new exception has to beat (B1.5.4).
    pub(crate) fn execution_priority(&self) -> i32 {
        let mask = if self.primask { self.mask_priority().min(0) } else { self.mask_priority() };
        mask.min(self.nvic.active_priority())
    }

    /// The priority that FAULTMASK or BASEPRI raises to.
    pub(crate) fn mask_priority(&self) -> i32 {
        match (self.faultmask, self.basepri) {
            (true, _) => HARD_FAULT_PRIORITY,
            (false, 0) => THREAD_PRIORITY,
            (false, priority) => self.nvic.group(priority),
        }
    }

    /// Ends WFI and WFE when their condition holds; WFI wakes for an exception that only PRIMASK masks (B1.5.18).
    pub(crate) fn wake(&mut self) {
        let awake = match self.activity {
            Activity::Running | Activity::Halted => return,
            Activity::AwaitingEvent if std::mem::take(&mut self.event) => true,
            Activity::AwaitingEvent | Activity::AwaitingInterrupt => self.nvic.best_pending().is_some_and(|number| {
                let floor = if self.activity == Activity::AwaitingEvent {
                    self.execution_priority()
                } else {
                    self.mask_priority().min(self.nvic.active_priority())
                };
                self.nvic.priority(number) < floor
            }),
        };
        if awake {
            self.activity = Activity::Running;
        }
    }

    /// Takes the most urgent pending exception, if it may preempt.
    pub(crate) fn take_pending<B: Bus>(&mut self, bus: &mut B) {
        let Some(number) = self.nvic.best_pending() else { return };
        if self.activity == Activity::Running && self.nvic.priority(number) < self.execution_priority() {
            self.enter(bus);
        }
    }

    /// Stacks the context and takes the exception that is most urgent by then (late arrival).
    fn enter<B: Bus>(&mut self, bus: &mut B) {
        let value = self.return_value();
        let begun = self.now;
        let stacked = self.push_frame(bus);
        self.now += ENTRY_CYCLES;
        if stacked.is_err() {
            self.system.fault_status |= status::STACKING;
            self.raise_now(exception::BUS);
        }
        self.synchronize(bus);
        self.start_handler(bus, value, begun);
    }

    /// EXC_RETURN for the present context.
    fn return_value(&self) -> u32 {
        let frame = if self.float_active { 0 } else { RETURN_BASIC_FRAME };
        let thread = if self.exception == 0 { RETURN_THREAD } else { 0 };
        let stack = if self.uses_process_stack() { RETURN_PROCESS } else { 0 };
        RETURN_PREFIX | frame | thread | stack
    }

    /// Starts the most urgent pending exception (ExceptionTaken, B1.5.6), whose entry has begun at `begun`.
    fn start_handler<B: Bus>(&mut self, bus: &mut B, return_value: u32, begun: Cycle) {
        let Some(number) = self.nvic.best_pending() else { return };
        if self.activity == Activity::Halted {
            return;
        }
        self.select_stack(|cpu| cpu.exception = number);
        self.nvic.activate(number);
        if let Some(handlers) = &mut self.handlers {
            handlers.begin(number, begun);
        }
        self.process_stack = false;
        self.float_active = false;
        self.float_ready = false;
        self.it = 0;
        self.exclusive = false;
        self.event = true;
        self.loaded = false;
        self.r[14] = return_value;
        match self.load_vector(bus, self.system.vector_table.wrapping_add(4 * u32::from(number))) {
            Ok(vector) => {
                self.pc = vector & !1;
                self.thumb = vector & 1 != 0;
            }
            Err(_) if self.execution_priority() <= HARD_FAULT_PRIORITY => self.halt(Stop::Lockup),
            Err(_) => {
                self.system.hard_fault_status |= status::VECTOR_TABLE;
                self.nvic.raise(exception::HARD_FAULT);
                self.start_handler(bus, return_value, begun);
            }
        }
    }

    pub(crate) fn load_vector<B: Bus>(&mut self, bus: &mut B, address: u32) -> Result<u32, Trap> {
        bus.read(self.now, address, Access::Word).map_err(|_| Trap::Bus(address))
    }

    /// PushStack (B1.5.6), with the floating-point part written now or only reserved.
    fn push_frame<B: Bus>(&mut self, bus: &mut B) -> Result<(), Trap> {
        let float = self.float_active;
        let align = float || self.system.configuration & configuration::ALIGN_STACK != 0;
        let padded = align && self.r[13] & 4 != 0;
        let size = if float { FLOAT_FRAME } else { BASIC_FRAME };
        let frame = self.r[13].wrapping_sub(size) & if align { !7 } else { !3 };
        let status = self.xpsr() & !PADDED | if padded { PADDED } else { 0 };
        let words = [self.r[0], self.r[1], self.r[2], self.r[3], self.r[12], self.r[14], self.pc, status];
        self.r[13] = frame;
        if float {
            if self.system.float_context & context::LAZY != 0 {
                self.reserve_float_frame(frame.wrapping_add(BASIC_FRAME));
            } else {
                self.store_float_frame(bus, frame.wrapping_add(BASIC_FRAME))?;
            }
        }
        self.store_words(bus, frame, &words)
    }

    fn store_words<B: Bus>(&mut self, bus: &mut B, address: u32, words: &[u32]) -> Result<(), Trap> {
        for (index, &word) in (0..).zip(words) {
            self.store(bus, address.wrapping_add(4 * index), Access::Word, word)?;
        }
        Ok(())
    }

    fn load_words<const N: usize, B: Bus>(&mut self, bus: &mut B, address: u32) -> Result<[u32; N], Trap> {
        let mut words = [0; N];
        for (index, word) in (0..).zip(&mut words) {
            *word = self.load(bus, address.wrapping_add(4 * index), Access::Word)?;
        }
        Ok(words)
    }

    /// UpdateFPCCR (B1.5.7): where the registers will go, and which faults could then be raised.
    fn reserve_float_frame(&mut self, address: u32) {
        let priority = self.execution_priority();
        let enabled = self.system.faults_enabled;
        let ready = |number: u16| enabled >> (number + 12) & 1 != 0 && self.nvic.priority(number) < priority;
        let flag = |set: bool, bit: u32| u32::from(set) << bit;
        self.system.float_context = self.system.float_context & context::WRITABLE
            | flag(true, 0)
            | flag(!self.privileged(), 1)
            | flag(self.exception == 0, 3)
            | flag(priority > HARD_FAULT_PRIORITY, 4)
            | flag(ready(exception::MEMORY), 5)
            | flag(ready(exception::BUS), 6);
        self.system.float_address = address & !7;
    }

    fn store_float_frame<B: Bus>(&mut self, bus: &mut B, address: u32) -> Result<(), Trap> {
        let mut words = [0; 17];
        words[..16].copy_from_slice(&self.s[..16]);
        words[16] = self.fpscr;
        self.now += FLOAT_STORE_CYCLES;
        self.store_words(bus, address, &words)
    }

    /// Prepares a floating-point instruction (ExecuteFPCheck, B1.5.7): checks access, stores the lazily stacked state,
    /// and creates a context of its own.
    #[cold]
    pub(crate) fn prepare_float<B: Bus>(&mut self, bus: &mut B) -> Result<(), Trap> {
        const FULL_ACCESS: u32 = 3;
        const PRIVILEGED_ACCESS: u32 = 1;
        let access = self.system.coprocessor_access >> 20 & 3;
        if access != FULL_ACCESS && !(access == PRIVILEGED_ACCESS && self.privileged()) {
            return Err(Trap::NoCoprocessor);
        }
        if self.system.float_context & context::LAZY_ACTIVE != 0 {
            let address = self.system.float_address;
            self.store_float_frame(bus, address).map_err(|_| Trap::LazyFloat)?;
            self.system.float_context &= !context::LAZY_ACTIVE;
        }
        if self.system.float_context & context::AUTOMATIC != 0 && !self.float_active {
            const DEFAULTS: u32 = 0x07c0_0000;
            self.float_active = true;
            self.fpscr = self.fpscr & !DEFAULTS | self.system.float_defaults;
        }
        self.float_ready = true;
        Ok(())
    }

    /// Returns from an exception after a load of EXC_RETURN into the PC in handler mode (B1.5.8).
    pub(crate) fn exception_return<B: Bus>(&mut self, bus: &mut B, value: u32) {
        let number = self.exception;
        let legal = self.nvic.is_active(number) && self.is_legal_return(value);
        self.nvic.deactivate(number);
        if number != exception::NMI {
            self.faultmask = false;
        }
        self.exclusive = false;
        self.event = true;
        self.synchronize(bus);
        if !legal {
            return self.chain_fault(bus, exception::USAGE, status::INVALID_PC, value & 0x0fff_ffff | 0xf000_0000);
        }
        let next = self.nvic.best_pending();
        if next.is_some_and(|next| self.nvic.priority(next) < self.execution_priority()) {
            self.end_handler();
            let begun = self.now;
            self.now += TAIL_CHAIN_CYCLES;
            return self.start_handler(bus, value, begun);
        }
        self.now += RETURN_CYCLES;
        if self.pop_frame(bus, value).is_err() {
            return self.chain_fault(bus, exception::BUS, status::UNSTACKING, value);
        }
        self.end_handler();
        if (self.exception == 0) != (value & RETURN_THREAD != 0) {
            return self.fault_after_return();
        }
        if self.exception == 0 && self.system.sleep & sleep::ON_EXIT != 0 {
            self.activity = Activity::AwaitingInterrupt;
        }
    }

    fn end_handler(&mut self) {
        if let Some(handlers) = &mut self.handlers {
            handlers.end(self.now);
        }
    }

    fn is_legal_return(&self, value: u32) -> bool {
        let last = self.nvic.active_count() == 1;
        let thread_allowed = last || self.system.configuration & configuration::NON_BASE_THREAD != 0;
        match value & 0xf {
            0x1 => value & RETURN_PREFIX == RETURN_PREFIX,
            0x9 | 0xd => thread_allowed && value & RETURN_PREFIX == RETURN_PREFIX,
            _ => false,
        }
    }

    /// Raises a fault of the return itself, which runs without unstacking first.
    fn chain_fault<B: Bus>(&mut self, bus: &mut B, number: u16, bit: u32, return_value: u32) {
        self.system.fault_status |= bit;
        self.raise_now(number);
        self.end_handler();
        let begun = self.now;
        self.now += TAIL_CHAIN_CYCLES;
        self.start_handler(bus, return_value, begun);
    }

    /// Raises the fault of a restored context whose IPSR contradicts the mode returned to.
    fn fault_after_return(&mut self) {
        self.system.fault_status |= status::INVALID_PC;
        self.raise_now(exception::USAGE);
    }

    /// PopStack (B1.5.8).
    fn pop_frame<B: Bus>(&mut self, bus: &mut B, value: u32) -> Result<(), Trap> {
        let process = value & RETURN_PROCESS != 0;
        let float = value & RETURN_BASIC_FRAME == 0;
        let frame = if process { self.other_stack } else { self.r[13] };
        let words: [u32; 8] = self.load_words(bus, frame)?;
        if float {
            self.restore_float(bus, frame.wrapping_add(BASIC_FRAME))?;
        }
        let align = float || self.system.configuration & configuration::ALIGN_STACK != 0;
        let size = if float { FLOAT_FRAME } else { BASIC_FRAME };
        let padding = if align && words[7] & PADDED != 0 { 4 } else { 0 };
        let restored = frame.wrapping_add(size) | padding;
        if process {
            self.other_stack = restored;
        } else {
            self.r[13] = restored;
        }
        self.r[..4].copy_from_slice(&words[..4]);
        self.r[12] = words[4];
        self.r[14] = words[5];
        self.pc = words[6] & !1;
        self.select_stack(|cpu| {
            cpu.set_xpsr(words[7]);
            if value & RETURN_THREAD != 0 {
                cpu.process_stack = process;
            }
        });
        self.float_active = float;
        self.float_ready = false;
        Ok(())
    }

    /// Keeps floating-point state that was never stored: it is still in the registers.
    fn restore_float<B: Bus>(&mut self, bus: &mut B, address: u32) -> Result<(), Trap> {
        if self.system.float_context & context::LAZY_ACTIVE != 0 {
            self.system.float_context &= !context::LAZY_ACTIVE;
            return Ok(());
        }
        let words: [u32; 17] = self.load_words(bus, address)?;
        self.s[..16].copy_from_slice(&words[..16]);
        self.set_fpscr(words[16]);
        self.now += FLOAT_STORE_CYCLES;
        Ok(())
    }
}
