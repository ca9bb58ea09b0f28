//! The STM32G474RE on its NUCLEO board: memories, clocks, timers, serial ports, DMA, flash. With the core it runs the
//! unmodified firmware, with the times of the silicon as far as the manuals state them.
//!
//! - [`Machine`]: core and chip together, with the firmware in flash; what most users want
//! - [`Chip`]: the bus behind the core; each peripheral is a file named as in the reference manual
//! - [`World`]: everything that is wired to the pins and serial ports
//! - [`Bench`]: the mechanics of the rig as such a world
//! - [`SerialDevice`]: a device on a serial port, such as a bus of servos
//! - [`LogDecoder`]: the log of the firmware as text
//!
//! Sections in comments are those of the reference manual RM0440 unless another document is named; its chapters kept
//! their numbers through its revisions, sections within them moved a little. What is missing is refused with the
//! name of its register. Simplifications are listed in `FIDELITY.md`.

mod alternate;
mod bench;
mod bus;
mod census;
mod chip;
mod clocks;
mod crc;
mod debug;
mod directory;
mod dma;
mod encoder_lines;
mod exti;
mod firmware;
mod flash;
mod flash_cells;
mod gpio;
mod halt;
mod iwdg;
mod log;
mod machine;
mod memory;
mod outside;
mod pads;
mod pages;
mod peripheral;
mod pin;
mod power_cut;
mod pwr;
mod rcc;
mod rng;
mod rtt;
mod schedule;
mod serial_device;
mod service;
mod servo_bus;
mod spi;
mod supply;
mod syscfg;
mod time;
mod timer;
mod trouble;
mod uart;
mod unit;
mod units;
mod vcd;
mod waiting;
mod wiring;
mod world;

pub use bench::{AxisWiring, Bench, BenchWiring, Fired, SwitchWiring};
pub use census::Touched;
pub use chip::{Chip, ChipConfig};
pub use clocks::ClockTree;
pub use firmware::{Firmware, FirmwareError};
pub use flash::FlashOperation;
pub use flash_cells::FlashCells;
pub use halt::{Halt, Place};
pub use log::{LogDecoder, LogEntry, LogError};
pub use machine::{Machine, Stops};
pub use memory::{FLASH_BASE, FLASH_SIZE, RAM_BASE, RAM_SIZE};
pub use pin::{Drive, Pin};
pub use power_cut::{Damage, PowerCut};
pub use rcc::ResetCause;
pub use rtt::{RttBuffer, read_rtt};
pub use serial_device::{OnPort, SerialDevice};
pub use spi::SpiFrame;
pub use time::{Picoseconds, TimeBase};
pub use trouble::Trouble;
pub use uart::{Frame, LineFault, SentByte};
pub use unit::{SpiId, TimerId, UartId};
pub use world::{Instant, Nothing, PinEdge, Terminals, World};
