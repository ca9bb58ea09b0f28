//! An ARMv7E-M core with FPv4-SP (Cortex-M4F): instructions, exceptions, NVIC, SysTick.
//!
//! The chip around it implements [`Bus`]. Time is counted in core clock cycles since power-on; the same program and the
//! same bus give the same cycles every time.
//!
//! Source: ARMv7-M Architecture Reference Manual (ARM DDI 0403E); sections in comments are its sections. Timings follow
//! the Cortex-M4 Technical Reference Manual (ARM 100166), chapter 3.

mod bus;
mod cache;
mod cpu;
mod decode;
mod exceptions;
mod execute;
mod fault_status;
mod faults;
mod float;
mod handlers;
mod instruction;
mod nvic;
mod operation;
mod private;
mod registers;
mod state;
mod system;
mod systick;

pub use bus::{Access, Bus, BusFault, Cycle, Lines, NEVER};
pub use cpu::{Cpu, Stop};
pub use fault_status::FaultStatus;
pub use handlers::HandlerTime;
pub use state::CoreState;
