//! A mechanical switch: contacts chatter, and long wires catch spikes.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// How badly a switch behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchNoise {
    /// How long the contact chatters after each change, microseconds.
    pub chatter_us: u64,
    /// How often it reads wrong for one instant without any cause: probability each time that it is looked at.
    pub spikes: f64,
    /// Decides both.
    pub seed: u64,
}

/// A switch as its wire reads it.
#[derive(Clone, Debug)]
pub struct Switch {
    closed: bool,
    reading: bool,
    fixed: Option<bool>,
    chatter_left_us: u64,
    noise: Option<(SwitchNoise, Pcg64Mcg)>,
}

impl Switch {
    /// A good switch.
    pub fn new(closed: bool) -> Self {
        Self { closed, reading: closed, fixed: None, chatter_left_us: 0, noise: None }
    }

    /// A switch that behaves badly from now on, or well again.
    pub fn disturb(&mut self, noise: Option<SwitchNoise>) {
        self.noise = noise.map(|noise| (noise, Pcg64Mcg::seed_from_u64(noise.seed)));
        self.chatter_left_us = 0;
        self.reading = self.closed;
    }

    /// A switch that reads this whatever happens to it, or is whole again.
    pub fn fix(&mut self, reading: Option<bool>) {
        self.fixed = reading;
    }

    /// What the wire reads.
    pub fn reads_closed(&self) -> bool {
        self.fixed.unwrap_or(self.reading)
    }

    /// The contact is `closed` after `us` have passed.
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
