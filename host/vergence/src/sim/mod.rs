//! The simulated rig: the native board, its own clock, and the ways to reach it (pipe, pty, TCP).

mod built;
mod rig;
mod serve;

pub use built::built;
pub use rig::{SharedRig, SimulatedRig};
pub use serve::{Listener, serve, spawn_in_process};
