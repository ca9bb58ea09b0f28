//! A load-side incremental encoder, and its failures.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Kind of failure of an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderFault {
    /// The count does not change any more.
    Stuck,
    /// The count runs the wrong way from now on: its channels are swapped.
    Reversed,
    /// Every reading is off by up to `amplitude` counts to either side.
    Noisy {
        /// Largest error in counts, not negative.
        amplitude: i32,
        /// Seed that decides the errors.
        seed: u64,
    },
    /// The encoder reads the count at which it was switched on.
    Dead,
}

/// Relation between the reading and the true count.
#[derive(Clone, Debug)]
enum Reading {
    True,
    Stuck(i32),
    Mirrored(i32),
    Noisy { amplitude: i32, random: Pcg64Mcg, error: i32 },
    Dead,
}

/// An encoder that counts from the position at which it was switched on.
#[derive(Clone, Debug)]
pub struct Encoder {
    zero: i32,
    reading: Reading,
}

impl Encoder {
    /// An encoder that is switched on where the scale reads `zero`.
    pub fn new(zero: i32) -> Self {
        Self { zero, reading: Reading::True }
    }

    /// The raw count where the scale reads `scale`.
    pub fn raw(&self, scale: i32) -> i32 {
        let count = scale.wrapping_sub(self.zero);
        match self.reading {
            Reading::True => count,
            Reading::Stuck(at) => at,
            Reading::Mirrored(pivot) => pivot.wrapping_sub(count.wrapping_sub(pivot)),
            Reading::Noisy { error, .. } => count.wrapping_add(error),
            Reading::Dead => 0,
        }
    }

    /// Makes the encoder fail where the scale reads `scale`, or work again.
    pub fn fail(&mut self, fault: Option<EncoderFault>, scale: i32) {
        let here = self.raw(scale);
        self.reading = match fault {
            None => Reading::True,
            Some(EncoderFault::Stuck) => Reading::Stuck(here),
            Some(EncoderFault::Reversed) => Reading::Mirrored(here),
            Some(EncoderFault::Noisy { amplitude, seed }) => {
                Reading::Noisy { amplitude: amplitude.max(0), random: Pcg64Mcg::seed_from_u64(seed), error: 0 }
            }
            Some(EncoderFault::Dead) => Reading::Dead,
        };
    }

    /// Counts truly again, from the count that it shows where the scale reads `scale`.
    pub fn go_on(&mut self, scale: i32) {
        self.zero = scale.wrapping_sub(self.raw(scale));
        self.reading = Reading::True;
    }

    /// Misses `counts` on its way up, or counts as many too many.
    pub fn lose(&mut self, counts: i32) {
        self.zero = self.zero.wrapping_add(counts);
    }

    /// The scale's reading where the raw count is `raw`; `None` where the count does not follow the scale.
    pub fn scale_at(&self, raw: i32) -> Option<i32> {
        matches!(self.reading, Reading::True).then(|| raw.wrapping_add(self.zero))
    }

    /// Counts from zero again where the scale reads `scale`; a failure lasts.
    pub fn restart(&mut self, scale: i32) {
        self.zero = scale;
        match &mut self.reading {
            Reading::Stuck(at) | Reading::Mirrored(at) => *at = 0,
            Reading::True | Reading::Noisy { .. } | Reading::Dead => {}
        }
    }

    /// Draws new noise, as time passes.
    pub fn advance(&mut self) {
        if let Reading::Noisy { amplitude, random, error } = &mut self.reading {
            *error = random.random_range(-*amplitude..=*amplitude);
        }
    }
}
