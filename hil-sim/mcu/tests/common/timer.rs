//! Registers of timers and their bits (RM0440 §28.6).

pub const CR1: u32 = 0x00;
pub const CR2: u32 = 0x04;
pub const SMCR: u32 = 0x08;
pub const DIER: u32 = 0x0C;
pub const SR: u32 = 0x10;
pub const EGR: u32 = 0x14;
pub const CCMR1: u32 = 0x18;
pub const CCER: u32 = 0x20;
pub const CNT: u32 = 0x24;
pub const PSC: u32 = 0x28;
pub const ARR: u32 = 0x2C;
pub const RCR: u32 = 0x30;
pub const CCR1: u32 = 0x34;
pub const BDTR: u32 = 0x44;

pub const CEN: u32 = 1;
pub const OPM: u32 = 8;
pub const DOWN: u32 = 0x10;
pub const ARPE: u32 = 0x80;
pub const MOE: u32 = 1 << 15;
pub const PWM_1: u32 = 6 << 4;
pub const PWM_2: u32 = 7 << 4;
pub const TOGGLE: u32 = 3 << 4;
