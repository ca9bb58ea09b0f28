//! Registers of serial ports and their bits (RM0440 §37.8), and a speed.

pub const CR1: u32 = 0x00;
pub const CR2: u32 = 0x04;
pub const CR3: u32 = 0x08;
pub const BRR: u32 = 0x0C;
pub const RTOR: u32 = 0x14;
pub const ISR: u32 = 0x1C;
pub const ICR: u32 = 0x20;
pub const RDR: u32 = 0x24;
pub const TDR: u32 = 0x28;

pub const UE: u32 = 1;
pub const RE: u32 = 1 << 2;
pub const TE: u32 = 1 << 3;
pub const FIFOEN: u32 = 1 << 29;

pub const NE: u32 = 1 << 2;
pub const FE: u32 = 1 << 1;
pub const ORE: u32 = 1 << 3;
pub const IDLE: u32 = 1 << 4;
pub const RXNE: u32 = 1 << 5;
pub const TC: u32 = 1 << 6;
pub const TXE: u32 = 1 << 7;
pub const RTOF: u32 = 1 << 11;

/// 16 MHz / 139 = 115 108 baud: a bit is 139 cycles, a frame 1390.
pub const BIT: u64 = 139;
pub const FRAME: u64 = 10 * BIT;
pub const BAUD: u32 = 115_108;
