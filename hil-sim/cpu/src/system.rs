//! State of the system control block, the FPU's context control and the debug counters (B3.2, B3.4, C1.8).

use crate::bus::Cycle;

/// Bits of CCR.
pub(crate) mod configuration {
    pub const NON_BASE_THREAD: u32 = 1;
    pub const USER_TRIGGER: u32 = 1 << 1;
    pub const TRAP_UNALIGNED: u32 = 1 << 3;
    pub const TRAP_DIVIDE: u32 = 1 << 4;
    pub const IGNORE_BUS_FAULTS: u32 = 1 << 8;
    pub const ALIGN_STACK: u32 = 1 << 9;
    pub const WRITABLE: u32 = 0x31b;
}

/// Bits of SCR.
pub(crate) mod sleep {
    pub const ON_EXIT: u32 = 1 << 1;
    pub const EVENT_ON_PENDING: u32 = 1 << 4;
    pub const WRITABLE: u32 = 0x16;
}

/// Bits of FPCCR.
pub(crate) mod context {
    pub const AUTOMATIC: u32 = 1 << 31;
    pub const LAZY: u32 = 1 << 30;
    pub const WRITABLE: u32 = 0xc000_0000;
    pub const LAZY_ACTIVE: u32 = 1;
}

/// Bits of CFSR and HFSR.
pub(crate) mod status {
    pub const INSTRUCTION_ACCESS: u32 = 1;
    pub const INSTRUCTION_BUS: u32 = 1 << 8;
    pub const PRECISE: u32 = 1 << 9;
    pub const UNSTACKING: u32 = 1 << 11;
    pub const STACKING: u32 = 1 << 12;
    pub const LAZY_FLOAT: u32 = 1 << 13;
    pub const BUS_ADDRESS_VALID: u32 = 1 << 15;
    pub const UNDEFINED: u32 = 1 << 16;
    pub const INVALID_STATE: u32 = 1 << 17;
    pub const INVALID_PC: u32 = 1 << 18;
    pub const NO_COPROCESSOR: u32 = 1 << 19;
    pub const UNALIGNED: u32 = 1 << 24;
    pub const DIVIDE_BY_ZERO: u32 = 1 << 25;
    /// HFSR: the vector table could not be read.
    pub const VECTOR_TABLE: u32 = 1 << 1;
    /// HFSR: escalated.
    pub const FORCED: u32 = 1 << 30;
    /// HFSR: a breakpoint with no debugger.
    pub const DEBUG_EVENT: u32 = 1 << 31;
}

/// DEMCR.TRCENA: the trace units, the cycle counter among them, are on.
const TRACE_ENABLE: u32 = 1 << 24;
/// DWT_CTRL.CYCCNTENA.
const CYCLE_COUNTER_ENABLE: u32 = 1;

#[derive(Clone)]
pub(crate) struct System {
    pub vector_table: u32,
    pub sleep: u32,
    pub configuration: u32,
    /// MEMFAULTENA, BUSFAULTENA and USGFAULTENA at bits 16 to 18.
    pub faults_enabled: u32,
    pub fault_status: u32,
    pub hard_fault_status: u32,
    pub debug_fault_status: u32,
    pub memory_fault_address: u32,
    pub bus_fault_address: u32,
    pub coprocessor_access: u32,
    pub float_context: u32,
    pub float_address: u32,
    pub float_defaults: u32,
    pub auxiliary_control: u32,
    pub debug_control: u32,
    pub trace_control: u32,
    /// The cycle counter is this plus the clock while it runs, else this alone.
    cycle_counter: u32,
}

impl System {
    pub const fn new() -> Self {
        Self {
            vector_table: 0,
            sleep: 0,
            configuration: configuration::ALIGN_STACK,
            faults_enabled: 0,
            fault_status: 0,
            hard_fault_status: 0,
            debug_fault_status: 0,
            memory_fault_address: 0,
            bus_fault_address: 0,
            coprocessor_access: 0,
            float_context: context::AUTOMATIC | context::LAZY,
            float_address: 0,
            float_defaults: 0,
            auxiliary_control: 0,
            debug_control: 0,
            trace_control: 0,
            cycle_counter: 0,
        }
    }

    const fn counts_cycles(&self) -> bool {
        self.debug_control & TRACE_ENABLE != 0 && self.trace_control & CYCLE_COUNTER_ENABLE != 0
    }

    pub const fn cycle_counter(&self, now: Cycle) -> u32 {
        if self.counts_cycles() { self.cycle_counter.wrapping_add(now as u32) } else { self.cycle_counter }
    }

    pub const fn set_cycle_counter(&mut self, now: Cycle, value: u32) {
        self.cycle_counter = if self.counts_cycles() { value.wrapping_sub(now as u32) } else { value };
    }

    /// Changes a control that may start or stop the cycle counter, which keeps its value.
    pub fn change_counting(&mut self, now: Cycle, change: impl FnOnce(&mut Self)) {
        let value = self.cycle_counter(now);
        change(self);
        self.set_cycle_counter(now, value);
    }
}
