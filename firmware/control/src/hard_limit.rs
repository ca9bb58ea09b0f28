//! The hard limit of an axis: its switches, filtered, and the way off them.
//!
//! One input stands for the switches of both ends and for a broken wire, so the board knows which way is out only from the
//! motion that met the limit. Where it does not know, a short distance may be tried. Distances are measured by the encoder
//! from the place at which the limit was met, so that a broken wire never lets an axis run away.

use crate::contact::DEBOUNCE_TICKS;

/// Number of readings in a row that show a limit as reached: a spike on a wire is shorter than two ticks.
const REACHED_TICKS: u8 = 2;

/// What the readings of the switches have shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct HardLimit {
    is_reached: bool,
    /// Number of readings in a row that say otherwise.
    run: u8,
    /// Sign of the motion at the first of them; 0 at rest.
    motion: i64,
    met: Met,
    /// Whether the fault was cleared, so that the axis may move off.
    is_known: bool,
}

/// Where and how a limit was met.
#[derive(Clone, Copy, Debug, Default)]
struct Met {
    /// Raw encoder count that rises along the axis.
    at: i32,
    /// Sign of the motion that met it; 0 where the axis was at rest.
    deeper: i64,
}

impl HardLimit {
    /// Takes the reading of a tick, the encoder's count and the sign of the commanded motion.
    pub fn read(&mut self, is_reached: bool, count: i32, motion: i64) {
        if is_reached == self.is_reached {
            self.run = 0;
            return;
        }
        if self.run == 0 {
            self.motion = motion;
        }
        self.run += 1;
        if self.run >= if is_reached { REACHED_TICKS } else { DEBOUNCE_TICKS } {
            let met = Met { at: count, deeper: self.motion };
            *self = Self { is_reached, met, ..Self::default() };
        }
    }

    /// Whether the limit is reached for certain.
    pub fn is_reached(&self) -> bool {
        self.is_reached
    }

    /// Whether it must stop all motion: reached, and nobody knows.
    pub fn trips(&self) -> bool {
        self.is_reached && !self.is_known
    }

    /// Notes that somebody knows: until it is released, the axis may move off.
    pub fn acknowledge(&mut self) {
        self.is_known = self.is_reached;
    }

    /// Encoder count at which it was met.
    pub fn met_at(&self) -> i32 {
        self.met.at
    }

    /// Whether an axis that stands at `from` may move to `to`, both counted from where it met the limit: away from it and
    /// not further than `retract` beyond that place, or half as far to either side where nobody knows which way is out.
    pub fn lets_go(&self, from: i64, to: i64, retract: i64) -> bool {
        match self.met.deeper {
            0 => to.abs() <= retract / 2,
            deeper => (to - from) * deeper < 0 && to * deeper >= -retract,
        }
    }
}
