//! Trajectories: positions over time in pieces of constant jerk, evaluated in integers.
//!
//! Positions are in 2⁻²⁴ micro-units, durations in 2⁻³² seconds: rounding stays below a ten-thousandth of a step and a
//! nanosecond over the longest move, and every machine computes the same bits.

use heapless::Vec;
use vergence_protocol::Microseconds;

/// A position in 2⁻²⁴ micro-units, or one of its derivatives with respect to seconds.
pub type Fine = i64;

/// Fraction bits of [`Fine`].
pub const FINE_BITS: u32 = 24;
const FINE_PER_MICRO: f32 = (1 << FINE_BITS) as f32;

/// A duration in 2⁻³² seconds.
pub(crate) type Ticks = i64;

const TICKS_PER_SECOND: f32 = 4_294_967_296.0;

/// Largest number of pieces: three of a stop, seven of a motion from rest and seven of the last approach.
pub(crate) const MOST_SEGMENTS: usize = 17;

/// State of an axis at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotionState {
    /// Position, in 2⁻²⁴ micro-units.
    pub position: Fine,
    /// Velocity, per second.
    pub velocity: Fine,
    /// Acceleration, per second squared.
    pub acceleration: Fine,
}

impl MotionState {
    /// The state of rest at `position`.
    #[must_use]
    pub const fn at(position: Fine) -> Self {
        Self { position, velocity: 0, acceleration: 0 }
    }

    /// Whether the axis is at rest.
    #[must_use]
    pub const fn is_rest(&self) -> bool {
        self.velocity == 0 && self.acceleration == 0
    }

    /// The state after `time` with constant jerk (Horner's scheme).
    pub(crate) fn after(&self, time: Ticks, jerk: Fine) -> Self {
        let Self { position, velocity, acceleration } = *self;
        let gained = scale(jerk, time);
        // The division comes last: over minutes the last bit of an acceleration makes a whole micro-unit.
        let slope = velocity + scale(3 * acceleration + gained, time) / 6;
        Self {
            position: position + scale(slope, time),
            velocity: velocity + scale(2 * acceleration + gained, time) / 2,
            acceleration: acceleration + gained,
        }
    }
}

/// `rate` per second times `time`.
fn scale(rate: Fine, time: Ticks) -> Fine {
    ((i128::from(rate) * i128::from(time) + (1 << 31)) >> 32) as Fine
}

/// Converts micro-units to [`Fine`]; saturates.
pub(crate) fn fine(micro: f32) -> Fine {
    (micro * FINE_PER_MICRO) as Fine
}

/// Converts [`Fine`] to micro-units.
pub(crate) fn micro(fine: Fine) -> f32 {
    fine as f32 / FINE_PER_MICRO
}

pub(crate) fn ticks(seconds: f32) -> Ticks {
    (seconds * TICKS_PER_SECOND) as Ticks
}

pub(crate) fn seconds(ticks: Ticks) -> f32 {
    ticks as f32 / TICKS_PER_SECOND
}

fn ticks_of(us: u64) -> Ticks {
    let (whole, rest) = (us / 1_000_000, us % 1_000_000);
    ((whole << 32) + (rest << 32) / 1_000_000) as Ticks
}

/// A piece of constant jerk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    pub start: MotionState,
    pub jerk: Fine,
    pub duration: Ticks,
}

impl Segment {
    pub fn end(&self) -> MotionState {
        self.start.after(self.duration, self.jerk)
    }

    /// The same piece backwards in time, with positions mirrored at `anchor`.
    pub fn reversed(&self, anchor: Fine) -> Self {
        let MotionState { position, velocity, acceleration } = self.end();
        let start = MotionState { position: anchor - position, velocity, acceleration: -acceleration };
        Self { start, ..*self }
    }
}

/// A motion that ends at rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trajectory {
    segments: Vec<Segment, MOST_SEGMENTS>,
    /// Duration of all pieces, and of the rest after them while other axes finish.
    duration: Ticks,
    target: Fine,
}

impl Trajectory {
    /// Rest at `position`, without any motion.
    pub(crate) fn resting_at(position: Fine) -> Self {
        Self { segments: Vec::new(), duration: 0, target: position }
    }

    /// Adds a piece. A piece without duration is left out; the planner never adds more pieces than there is room for.
    pub(crate) fn push(&mut self, segment: Segment) {
        if segment.duration > 0 && self.segments.push(segment).is_ok() {
            self.duration += segment.duration;
        }
    }

    /// Adds a motion that begins where this one ends. Rest at the end of this one comes after it.
    pub(crate) fn append(&mut self, next: &Self) {
        next.segments.iter().for_each(|&segment| self.push(segment));
        self.target = next.target;
    }

    /// The pieces backwards in time, so that they end at rest at `target`.
    pub(crate) fn backwards(&self, target: Fine) -> impl Iterator<Item = Segment> {
        self.segments.iter().rev().map(move |segment| segment.reversed(target))
    }

    /// Sets the position of rest: it differs by rounding, less than a thousandth of a micro-unit.
    pub(crate) fn rest_at(&mut self, target: Fine) {
        self.target = target;
    }

    /// Adds rest at the target until `duration` seconds have passed, so that axes finish in the same tick.
    pub fn rest_until(&mut self, duration: f32) {
        self.duration = self.duration.max(ticks(duration));
    }

    /// Duration in seconds, including the rest at the end.
    #[must_use]
    pub fn duration(&self) -> f32 {
        seconds(self.duration)
    }

    /// Time after the start at which the trajectory is over, rounded up to a microsecond.
    #[must_use]
    pub fn ends(&self) -> Microseconds {
        let (whole, rest) = (self.duration >> 32, self.duration & 0xffff_ffff);
        Microseconds((whole * 1_000_000 + ((rest * 1_000_000) >> 32) + 1) as u64)
    }

    /// Position of rest at the end.
    #[must_use]
    pub fn target(&self) -> Fine {
        self.target
    }

    /// Start of each piece: seconds since the start of the trajectory, state, and jerk of the piece; last the end, at rest.
    pub fn knots(&self) -> impl Iterator<Item = (f64, MotionState, Fine)> + '_ {
        let mut begins = 0;
        let pieces = self.segments.iter().map(move |segment| {
            let start = begins;
            begins += segment.duration;
            (start as f64 / f64::from(TICKS_PER_SECOND), segment.start, segment.jerk)
        });
        let end = (self.duration as f64 / f64::from(TICKS_PER_SECOND), MotionState::at(self.target), 0);
        pieces.chain((self.duration > 0).then_some(end))
    }

    /// The state at the time `elapsed` after the start.
    #[must_use]
    pub fn state(&self, elapsed: Microseconds) -> MotionState {
        self.state_at(ticks_of(elapsed.0))
    }

    fn state_at(&self, mut left: Ticks) -> MotionState {
        for segment in &self.segments {
            if left < segment.duration {
                return segment.start.after(left, segment.jerk);
            }
            left -= segment.duration;
        }
        MotionState::at(self.target)
    }

    /// Whether the trajectory is over at the time `elapsed` after the start.
    #[must_use]
    pub fn is_over(&self, elapsed: Microseconds) -> bool {
        ticks_of(elapsed.0) >= self.duration
    }

    /// The pieces between two instants, each with the seconds from `from` to its start.
    pub(crate) fn pieces(&self, from: Microseconds, to: Microseconds) -> impl Iterator<Item = (f32, Segment)> {
        let (from, to) = (ticks_of(from.0), ticks_of(to.0));
        let mut begins = 0;
        self.segments.iter().filter_map(move |segment| {
            let (start, end) = (begins, begins + segment.duration);
            begins = end;
            let (first, last) = (start.max(from), end.min(to));
            (first < last).then(|| {
                let part = Segment {
                    start: segment.start.after(first - start, segment.jerk),
                    duration: last - first,
                    ..*segment
                };
                (seconds(first - from), part)
            })
        })
    }
}
