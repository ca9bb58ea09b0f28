//! Simulated boards for the command: read from files, served, and driven in this process.

mod connected;
mod files;

use vergence_board::Shared;

pub use connected::board_of;
pub use files::{KeptRig, simulated_chip};
pub use vergence_board::{Listener, Served, serve, spawn_in_process};
pub use vergence_sim::{Random, SimulatedChip, SimulatedRig, built};

/// A simulated rig, shared between the task that serves it and the cameras on it.
pub type SharedRig = Shared<SimulatedRig>;
