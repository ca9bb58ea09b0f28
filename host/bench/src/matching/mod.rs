//! Matches of simulated pairs that are right, over the angle between the optical axes.

mod judge;
mod means;
mod network_clock;
mod reliability;
mod report;
mod simulated_pair;
mod ways;

pub use judge::{Class, Tally};
pub use means::Means;
pub use network_clock::NetworkClock;
pub use reliability::Reliability;
pub use simulated_pair::SimulatedPair;
pub use ways::{Outcome, Way};
