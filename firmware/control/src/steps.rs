//! Step times: the times at which a trajectory crosses the middle between two steps.

use heapless::Vec;
use libm::fabsf;

use crate::io::MAX_STEPS_PER_TICK;
use crate::settings::Scale;
use crate::trajectory::{Fine, Segment, micro, seconds};

/// Accuracy in seconds at which Newton's method ends: a twentieth of the promised accuracy.
const CONVERGED_S: f32 = 50e-9;
/// Largest number of rounds: Newton's method doubles its digits each time; if it leaves the bracket, as many halvings narrow
/// a tick to 15 ns.
const MOST_ROUNDS: u32 = 16;
const NS_PER_S: f32 = 1e9;
/// The last nanosecond of a tick.
const LAST_NS: u32 = 999_999;

/// Times of steps, in nanoseconds after the start of their tick.
pub type Instants = Vec<u32, MAX_STEPS_PER_TICK>;

/// The step at which a motor is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepCounter {
    /// Half the distance between two steps, in 2⁻⁴⁰ micro-units.
    half_step: i64,
    step: i64,
}

impl StepCounter {
    /// A motor at the step nearest to `position`.
    pub fn new(motor: Scale, position: Fine) -> Self {
        let half_step = motor.half_mark_q40();
        let halves = (i128::from(position) << 16).div_euclid(i128::from(half_step));
        Self { half_step, step: (halves + 1).div_euclid(2) as i64 }
    }

    /// The position halfway between this step and the next one above.
    fn middle_above(&self) -> Fine {
        ((i128::from(2 * self.step + 1) * i128::from(self.half_step)) >> 16) as Fine
    }

    /// Moves to the step nearest to `end`, to which the `pieces` of a tick lead. Returns whether the steps go forward, and
    /// the time of each. A motor that turns round within a tick makes only the difference at its end. Steps that find no
    /// room wait for the next tick.
    pub fn follow(&mut self, pieces: impl Iterator<Item = (f32, Segment)>, end: Fine) -> (bool, Instants) {
        let (above, length) = (self.middle_above(), (self.half_step + (1 << 14)) >> 15);
        let forward = end >= above;
        // Mirrored, so that the position rises. A step back is made when the middle is passed, not when it is reached.
        let (sign, mut middle) = if forward { (1, above) } else { (-1, length - above + 1) };
        let end = sign * end;
        let apart = micro(length);
        let mut instants = Instants::new();
        for (begins, piece) in pieces {
            let start = sign * piece.start.position;
            let reached = (sign * piece.end().position).min(end);
            let rise = Rise::new(&piece, sign as f32);
            if middle > reached {
                continue;
            }
            // Heights are counted in single precision: to compare and convert each of them in 64 bits takes a third of the
            // time.
            let (first, mut at) = (micro(middle - start), 0.0);
            let room = (MAX_STEPS_PER_TICK - instants.len()) as i64;
            let steps = ((reached - middle) / length + 1).min(room);
            middle += steps * length;
            for step in 0..steps as u32 {
                at = rise.crosses(first + step as f32 * apart, at);
                let _ = instants.push((((begins + at) * NS_PER_S) as u32).min(LAST_NS));
            }
        }
        // Steps that rounding has hidden between two pieces are due at the end.
        while middle <= end && instants.push(LAST_NS).is_ok() {
            middle += length;
        }
        self.step += sign * instants.len() as i64;
        (forward, instants)
    }
}

/// A piece as a cubic polynomial of seconds, mirrored so that it rises as a whole.
#[derive(Clone, Copy, Debug)]
struct Rise {
    velocity: f32,
    acceleration: f32,
    jerk: f32,
    duration: f32,
}

impl Rise {
    fn new(piece: &Segment, sign: f32) -> Self {
        let [velocity, acceleration, jerk] =
            [piece.start.velocity, piece.start.acceleration, piece.jerk].map(|rate| sign * micro(rate));
        Self { velocity, acceleration, jerk, duration: seconds(piece.duration) }
    }

    /// Time at which the piece has risen by `height`, between the time `after` and its end: Newton's method inside a
    /// bracket.
    fn crosses(&self, height: f32, after: f32) -> f32 {
        let Self { velocity: v, acceleration: a, jerk: j, duration } = *self;
        let (half_a, half_j, sixth_j) = (a / 2.0, j / 2.0, j / 6.0);
        let (mut low, mut high) = (after, duration);
        let mut t = low;
        for _ in 0..MOST_ROUNDS {
            let left = height - t * (v + t * (half_a + t * sixth_j));
            if left > 0.0 {
                low = t;
            } else {
                high = t;
            }
            let slope = v + t * (a + t * half_j);
            let by = left / slope;
            let newton = t + by;
            // False as well if the slope is zero: then `newton` is infinite or not a number.
            let inside = newton >= low && newton <= high;
            // The error left is at most the curvature times the square of the last step.
            let bend = fabsf(a + t * j) + fabsf(j * by);
            let slope_there = v + newton * (a + newton * half_j);
            if inside && bend * by * by < CONVERGED_S * slope.min(slope_there) {
                return newton;
            }
            let next = if inside { newton } else { f32::midpoint(low, high) };
            if fabsf(next - t) < CONVERGED_S {
                return next;
            }
            t = next;
        }
        t
    }
}
