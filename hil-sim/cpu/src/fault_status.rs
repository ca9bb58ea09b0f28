//! The fault status registers as text.

use crate::cpu::Cpu;
use crate::system::status;

/// The contents of CFSR, HFSR and BFAR after a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultStatus {
    /// CFSR: faults of memory, bus and use.
    pub configurable: u32,
    /// HFSR: the cause of the HardFault.
    pub hard: u32,
    /// BFAR, while it is valid: the data address that was not answered.
    pub bus_address: Option<u32>,
}

/// Bits of CFSR.
const CONFIGURABLE: [(u32, &str); 12] = [
    (status::INSTRUCTION_ACCESS, "code fetched from a region that holds none"),
    (status::INSTRUCTION_BUS, "code fetched where no memory answers"),
    (status::PRECISE, "data access that nothing answers"),
    (status::UNSTACKING, "bus fault while the stack was restored"),
    (status::STACKING, "bus fault while the stack was saved"),
    (status::LAZY_FLOAT, "bus fault while the floating-point state was saved"),
    (status::UNDEFINED, "undefined instruction"),
    (status::INVALID_STATE, "jump to an even address"),
    (status::INVALID_PC, "return to an impossible context"),
    (status::NO_COPROCESSOR, "coprocessor absent or not enabled"),
    (status::UNALIGNED, "unaligned access"),
    (status::DIVIDE_BY_ZERO, "division by zero"),
];
/// Bits of HFSR.
const HARD: [(u32, &str); 3] = [
    (status::VECTOR_TABLE, "vector table unreadable"),
    (status::FORCED, "fault escalated to HardFault"),
    (status::DEBUG_EVENT, "breakpoint with no debugger"),
];

impl FaultStatus {
    /// One phrase for each bit that is set, those of CFSR first; none after a reset.
    pub fn reasons(self) -> impl Iterator<Item = &'static str> {
        let configurable = CONFIGURABLE.iter().filter(move |(bit, _)| self.configurable & bit != 0);
        let hard = HARD.iter().filter(move |(bit, _)| self.hard & bit != 0);
        configurable.chain(hard).map(|&(_, reason)| reason)
    }
}

impl Cpu {
    /// The fault status, which stays until the program or a reset clears it.
    #[must_use]
    pub fn fault_status(&self) -> FaultStatus {
        let valid = self.system.fault_status & status::BUS_ADDRESS_VALID != 0;
        FaultStatus {
            configurable: self.system.fault_status,
            hard: self.system.hard_fault_status,
            bus_address: valid.then_some(self.system.bus_fault_address),
        }
    }
}
