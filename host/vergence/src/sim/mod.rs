//! The simulated rig: the native board or the firmware on a simulated chip, its own clock, and the ways to reach it
//! (pipe, pty, TCP).

mod built;
mod chip;
mod connected;
mod history;
mod pace;
mod random;
mod rig;
mod serve;
mod served;

pub use built::built;
pub use chip::SimulatedChip;
pub use connected::board_of;
pub use history::LoadHistory;
pub use random::Random;
pub use rig::{Pulse, SharedRig, SimulatedRig};
pub use serve::{Listener, serve, spawn_in_process};
pub use served::{Served, Shared};
