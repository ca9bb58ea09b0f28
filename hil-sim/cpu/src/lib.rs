//! An ARMv7E-M core with FPv4-SP (Cortex-M4F): instructions, exceptions, NVIC, SysTick.
//!
//! The chip around it is behind [`Bus`]. Time is counted in core clock cycles since power-on; the same program and the
//! same bus give the same cycles every time.

mod bus;

pub use bus::{Access, Bus, BusFault, Cycle, Lines, NEVER};
