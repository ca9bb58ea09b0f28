//! What boot loader and application of the NUCLEO-G474RE share: clocks, flash and what becomes of words that power-off tore,
//! the swap's state, the memory kept through resets, and how a program dies.

#![no_std]

pub mod clocks;
pub mod death;
mod ecc;
mod flash;
pub mod memory;
mod services;
mod swap;

pub use flash::{Area, FedFlash, feed_watchdog};
pub use services::Services;
pub use swap::SwapState;
