//! A mechanical switch, whose contacts chatter and whose wires pick up spikes.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Chatter and spikes of a switch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchNoise {
    /// Duration of the chatter after each change, in microseconds.
    pub chatter_us: u64,
    /// Probability that one reading is wrong without a cause.
    pub spikes: f64,
    /// Seed that decides both.
    pub seed: u64,
}

/// A switch with its wire.
#[derive(Clone, Debug)]
pub struct Switch {
    closed: bool,
    reading: bool,
    fixed: Option<bool>,
    chatter_left_us: u64,
    noise: Option<(SwitchNoise, Pcg64Mcg)>,
}

impl Switch {
    /// A switch without faults.
    pub fn new(closed: bool) -> Self {
        Self { closed, reading: closed, fixed: None, chatter_left_us: 0, noise: None }
    }

    /// Adds chatter and spikes from now on, or removes them.
    pub fn disturb(&mut self, noise: Option<SwitchNoise>) {
        self.noise = noise.map(|noise| (noise, Pcg64Mcg::seed_from_u64(noise.seed)));
        self.chatter_left_us = 0;
        self.reading = self.closed;
    }

    /// Fixes the reading, or lets it follow the contact again.
    pub fn fix(&mut self, reading: Option<bool>) {
        self.fixed = reading;
    }

    /// The reading of the wire.
    pub fn reads_closed(&self) -> bool {
        self.fixed.unwrap_or(self.reading)
    }

    /// Sets the contact to `closed` after `us` microseconds have passed.
    pub fn advance(&mut self, closed: bool, us: u64) {
        let changed = closed != self.closed;
        self.closed = closed;
        self.reading = closed;
        let Some((noise, random)) = &mut self.noise else { return };
        self.chatter_left_us = if changed { noise.chatter_us } else { self.chatter_left_us.saturating_sub(us) };
        let wrong = if self.chatter_left_us > 0 { 0.5 } else { noise.spikes };
        self.reading = closed != random.random_bool(wrong.clamp(0.0, 1.0));
    }
}
