//! The controller of the rig: planner, homing, limits and safety states (`no_std`, no async, no I/O).
//!
//! [`Controller`] is the heart. It has two entry points: `handle` takes a request, `poll` runs one control tick against
//! the board behind [`RigIo`]. Time is an argument. [`Node`] adds the serial session, so that a firmware shell, a native
//! simulation and an emulated board all run the same code.
//!
//! Terms: *command* is where the planner wants an axis, *encoder* is where it is; *following error* is their difference;
//! an axis is *referenced* once homing has tied its encoder to the axis zero; *settled* means that the encoder has
//! stayed inside the tolerance for a dwell; the *lease* is how long a silent host is trusted; a fault is *latched* until cleared.

#![no_std]

mod axis;
mod board_settings;
mod contact;
mod controller;
mod flash;
mod follow;
mod homing;
mod homing_sequence;
mod io;
mod latch;
mod lease;
mod node;
mod profile;
mod recorder;
mod self_test;
mod services;
mod settings;
pub mod settings_store;
mod steps;
mod trajectory;
mod trigger;
mod updater;

pub use board_settings::{BoardSettings, Machine, SettingError};
pub use controller::{Controller, Event};
pub use flash::{Flash, FlashError, PAGE, UNIT};
pub use io::{MAX_STEPS_PER_TICK, RigIo, StepSchedule, TriggerEdge};
pub use node::{Node, NodeIdentity};

pub use profile::Limits;
pub use services::BoardServices;
pub use settings::{AxisSettings, HomingSettings, LARGEST_STEP_RATE, Scale, SettingsError};
pub use trajectory::{FINE_BITS, Fine, MotionState, Trajectory};
pub use updater::Updater;

/// The control tick: how often `poll` wants to run while the drivers are on, in microseconds.
pub const TICK_US: u64 = 1_000;
/// How often a [`Node`] at rest wants to run: whole ticks. A board's microsecond counter of 16 bits must hold it.
pub const REST_US: u64 = 20 * TICK_US;
