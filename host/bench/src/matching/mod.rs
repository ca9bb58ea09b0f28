//! Matches of simulated pairs that are right, over the angle between the optical axes.

mod judge;
mod network_clock;
mod simulated_pair;
mod ways;

pub use judge::{Class, Tally};
pub use network_clock::NetworkClock;
pub use simulated_pair::SimulatedPair;
pub use ways::{Outcome, Way};
