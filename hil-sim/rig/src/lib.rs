//! The whole simulated rig in virtual time: board, mechanics, cameras and room.
//!
//! - [`SimulatedRig`]: the controller core or the firmware on simulated mechanics, with the truth beside it
//! - [`SimulatedChip`]: the unmodified firmware on the simulated microcontroller, wired to the same mechanics
//! - [`RoomCamera`] and [`LiveCamera`]: cameras on the mechanics, in a furnished [`Room`]
//! - [`TargetCamera`]: cameras before which a simulated person holds a calibration target ([`HeldTarget`])
//! - [`flatten`] and [`FirmwareLog`]: what a linker makes, as the bytes in flash and as the texts of the firmware's log
//! - [`Trunk`]: the robot's folding trunk, moved by simulated servos
//! - [`built`]: a rig as it was really built, for a calibration to find; [`BentRail`]: a rail that is not straight
//!
//! ```
//! use vergence_rig::{BENCH_TOML, Rig};
//! use vergence_sim::SimulatedRig;
//!
//! let rig = Rig::from_toml(BENCH_TOML)?;
//! let mut simulated = SimulatedRig::new(&rig, 1)?;
//! simulated.run_until(1_000_000); // one second
//! assert!(simulated.true_pose().axes[0].value() > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Time is an argument everywhere: a program that serves or watches a simulated rig drives it with its own clock. The same
//! seed gives the same bytes. Nothing here reads or writes a file.

mod application;
mod bent_rail;
mod built;
mod chip;
mod controller;
mod error;
mod firmware_log;
mod held_target;
mod history;
mod live_camera;
mod native;
mod random;
mod rig;
mod room;
mod trunk;
mod unplugged;

pub use application::{ApplicationError, build_of, check_boot_loader, flatten, is_elf};
pub use bent_rail::BentRail;
pub use built::built;
pub use chip::{Program, SimulatedChip, robot_settings};
pub use error::SimError;
pub use firmware_log::{FirmwareLog, PlacedEntry};
pub use held_target::{HeldTarget, TargetCamera, photograph_target};
pub use history::LoadHistory;
pub use live_camera::{LiveCamera, Rendering};
pub use random::Random;
pub use rig::{Pulse, SimulatedRig};
pub use room::{Room, RoomCamera};
pub use trunk::{Collision, DrivenTrunk, FIRST_SERVO_ID, Play, Trunk, TrunkMechanics, joint_settings, trunk_servos};
pub use unplugged::{Unplug, Unplugged};
