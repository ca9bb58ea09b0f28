//! The controller of the rig: planner, homing, limits and safety states (`no_std`, no async, no I/O).
//!
//! [`Controller`] has two entry points: `handle` takes a request, `poll` runs one control tick against the board behind
//! [`RigIo`]. Moves are planned elsewhere, below the tick: `take_plan_request`, [`MovePlanner`], `give_plan`. Time is an
//! argument. [`Node`] adds the serial session, so that the firmware, the native simulation and the
//! emulated board all run the same code.
//!
//! Terms: the *command* is the position that the planner wants, the *encoder* the position that is measured, and the
//! *following error* their difference. An axis is *referenced* once homing has tied its encoder to the axis zero. A move is
//! *settled* when the encoders have stayed inside the tolerance for a while. The *lease* is the time that the board keeps
//! going without hearing from its host. A fault is *latched* until it is cleared.

#![no_std]

mod as5048a;
mod axis;
mod axis_items;
mod board_settings;
mod bounds;
mod contact;
mod controller;
pub mod driver;
mod encoder;
mod follow;
mod hard_limit;
mod holding;
mod homing;
mod homing_sequence;
mod index;
mod io;
pub mod joints;
mod latch;
mod lease;
mod line_speed;
mod move_planner;
mod node;
mod plan;
mod profile;
mod recorder;
mod self_test;
mod services;
mod settings;
pub mod settings_store;
mod stall_homing;
mod steps;
mod switches;
mod trajectory;
mod trigger;
mod updater;

pub use as5048a::As5048a;
pub use board_settings::{BoardSettings, Delivered, Machine, SettingError};
pub use bounds::LONGEST_BRAKING_MS;
pub use controller::{Controller, Event, plan_ticks};
pub use driver::{DriverKind, DriverSettings};
pub use encoder::{EncoderKind, EncoderSettings, TURN};
pub use io::{IndexEdge, IndexEdges, MAX_STEPS_PER_TICK, RigIo, StepSchedule, TriggerEdge};
pub use move_planner::{MovePlanner, PlanRequest, PlannedWay};
pub use node::{Node, NodeIdentity};
pub use plan::{AxisPlanner, PlanStart};
pub use profile::Limits;
pub use services::{BoardServices, Flash, FlashError, PAGE, UNIT};
pub use settings::{AxisSettings, HomingSettings, LARGEST_STEP_RATE, Scale, SettingsError};
pub use switches::{HomeEnd, HomeSensor, SwitchSettings};
pub use trajectory::{FINE_BITS, Fine, MotionState, Trajectory};
pub use updater::Updater;

/// Period of the control tick in microseconds: [`Controller::poll`] runs this often while the drivers are on.
pub const TICK_US: u64 = 1_000;
/// Period of the ticks of a [`Node`] at rest, in microseconds: whole ticks, and small enough for a 16-bit counter.
pub const REST_US: u64 = 20 * TICK_US;
