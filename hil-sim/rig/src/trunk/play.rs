//! Play of a joint: how far it is from where its servo holds it, which no encoder shows.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::DRIVEN;

/// The play of one driven joint: it leans to the side of its load, and wanders slowly besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play {
    /// Angle from one end of the play to the other, in radians.
    pub width: f64,
    /// Period in which it wanders, in seconds, and where it begins, as a share of it.
    pub period: f64,
    /// Where the wandering begins, as a share of the period.
    pub phase: f64,
}

/// Load at which a joint leans to its side, in newton metres (assumed).
const LEANING: f64 = 0.1;
/// Share of the play that follows the load; the rest wanders.
const BY_LOAD: f64 = 0.6;

impl Play {
    /// None.
    pub const NONE: Self = Self { width: 0.0, period: 1.0, phase: 0.0 };

    /// Play of 0.1 to 0.3 degrees for each driven joint, which wanders within 20 to 60 seconds.
    #[must_use]
    pub fn of_seed(seed: u64) -> [Self; DRIVEN] {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut between = |least: f64, largest: f64| least + (largest - least) * random.random::<f64>();
        std::array::from_fn(|_| Self {
            width: between(0.1, 0.3).to_radians(),
            period: between(20.0, 60.0),
            phase: between(0.0, 1.0),
        })
    }

    /// The angle from the middle of the play at an instant under a load in newton metres; at most half the width.
    #[must_use]
    pub fn at(&self, seconds: f64, load: f64) -> f64 {
        let wander = (TAU * (seconds / self.period + self.phase)).sin();
        let lean = (load / LEANING).tanh();
        self.width / 2.0 * (BY_LOAD * lean + (1.0 - BY_LOAD) * wander)
    }
}
