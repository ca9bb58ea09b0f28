//! The native board and the firmware on the chip play the same random session and must do the same.
//!
//! [`Session::of`] draws a session from its seed: homes, moves, new targets in mid-move, jogs, stops, settings, triggers,
//! failures of the mechanics, late ticks, silence of the host, resets, updates, and questions. [`play`] gives both boards the same bytes
//! and the same mishaps at the same instants, compares every message, pose, step and place, and ends with the first
//! difference. What differs by design is listed in `hil-sim/FIDELITY.md`.

mod compare;
mod delivered;
mod difference;
mod driver;
mod messages;
mod mishap;
mod pair;
mod session;
mod side;
mod slack;
mod steps;
mod tally;
mod update;

pub use delivered::{Delivered, NextImage};
pub use difference::{Difference, Figures, Verdict};
pub use driver::play;
pub use mishap::Mishap;
pub use session::{Act, Fate, Session};
pub use steps::Phase;
pub use tally::{DifferentialTally, differential};
