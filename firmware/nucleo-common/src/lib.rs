//! Parts that boot loader and application of the NUCLEO-G474RE share: clocks, flash, the state of a swap, the trusted key,
//! the memory kept through resets, and the record of a program's death.

#![no_std]

pub mod clocks;
pub mod death;
mod flash;
mod key;
pub mod memory;
mod services;
mod swap;

pub use flash::{Area, FedFlash, feed_watchdog};
pub use key::trusted_key;
pub use services::Services;
pub use swap::SwapState;
