//! Jerk-limited motion profiles: rest to rest in seven segments, and the quickest stop from any state.
//!
//! L. Biagiotti and C. Melchiorri, *Trajectory Planning for Automatic Machines and Robots*, 2008, §3.4 (double S).
//! Single precision: the microcontroller has a single-precision FPU, and 2⁻²⁴ of the longest move is below an encoder count.

use libm::{cbrtf, fabsf, sqrtf};

/// What an axis can do, in micro-units per second to the power of one, two and three. All positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest speed.
    pub speed: f32,
    /// Largest acceleration.
    pub acceleration: f32,
    /// Largest jerk.
    pub jerk: f32,
}

impl Limits {
    /// The limits of the same motion run `factor` times as fast: the path through time keeps its shape.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        Self {
            speed: self.speed * factor,
            acceleration: self.acceleration * factor * factor,
            jerk: self.jerk * factor * factor * factor,
        }
    }
}

/// Where a profile is at one instant: offset from its start in micro-units, and the derivatives per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionState {
    /// Offset from the start of the profile.
    pub offset: f32,
    /// Velocity.
    pub velocity: f32,
    /// Acceleration.
    pub acceleration: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Segment {
    duration: f32,
    jerk: f32,
}

/// A motion of one axis: up to seven segments of constant jerk, at rest afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    start: MotionState,
    segments: [Segment; 7],
    duration: f32,
    /// The exact end: rounding in the segments never decides where an axis stops.
    end: f32,
}

impl Profile {
    /// The quickest motion over `distance` from rest to rest.
    #[must_use]
    pub fn rest_to_rest(distance: f32, limits: Limits) -> Self {
        let length = fabsf(distance);
        let jerk = if distance < 0.0 { -limits.jerk } else { limits.jerk };
        let peak = peak_speed(length, limits);
        let (ramp, hold) = speed_change(peak, limits);
        // Distance covered by speeding up and by slowing down: half the peak speed times the time, each.
        let cruise = if peak > 0.0 { (length / peak - (2.0 * ramp + hold)).max(0.0) } else { 0.0 };
        let segments = [
            Segment { duration: ramp, jerk },
            Segment { duration: hold, jerk: 0.0 },
            Segment { duration: ramp, jerk: -jerk },
            Segment { duration: cruise, jerk: 0.0 },
            Segment { duration: ramp, jerk: -jerk },
            Segment { duration: hold, jerk: 0.0 },
            Segment { duration: ramp, jerk },
        ];
        Self { start: MotionState::default(), segments, duration: total(&segments), end: distance }
    }

    /// The quickest way to rest from `velocity` and `acceleration`.
    #[must_use]
    pub fn stop(velocity: f32, acceleration: f32, limits: Limits) -> Self {
        let Limits { acceleration: a_max, jerk: j, .. } = limits;
        // The velocity that is left once the acceleration alone has been brought to zero.
        let remaining = velocity + acceleration * fabsf(acceleration) / (2.0 * j);
        // Mirror so that the velocity must be raised to zero: acceleration climbs to a peak, holds, and returns.
        let sign = if remaining > 0.0 { -1.0 } else { 1.0 };
        let (v, a) = (sign * velocity, sign * acceleration);
        let peak = sqrtf((-v * j + 0.5 * a * a).max(0.0)).min(a_max).max(a);
        let gained = (2.0 * peak * peak - a * a) / (2.0 * j);
        let hold = if peak > 0.0 { ((-v - gained) / peak).max(0.0) } else { 0.0 };
        let mut segments = [Segment::default(); 7];
        segments[0] = Segment { duration: (peak - a) / j, jerk: sign * j };
        segments[1] = Segment { duration: hold, jerk: 0.0 };
        segments[2] = Segment { duration: peak / j, jerk: -sign * j };
        let start = MotionState { offset: 0.0, velocity, acceleration };
        let end = run(start, &segments, f32::INFINITY).offset;
        Self { start, segments, duration: total(&segments), end }
    }

    /// The same path run `factor` times as slowly. For profiles from rest.
    #[must_use]
    pub fn stretched(mut self, factor: f32) -> Self {
        for segment in &mut self.segments {
            segment.duration *= factor;
            segment.jerk /= factor * factor * factor;
        }
        self.duration *= factor;
        self
    }

    /// The same path run in exactly `duration` seconds, so that axes finish in the same tick. For profiles from rest;
    /// one that goes nowhere stays as it is.
    #[must_use]
    pub fn lasting(self, duration: f32) -> Self {
        if self.duration > 0.0 { Self { duration, ..self.stretched(duration / self.duration) } } else { self }
    }

    /// How long it takes, in seconds.
    #[must_use]
    pub fn duration(&self) -> f32 {
        self.duration
    }

    /// Where it ends, as an offset from its start.
    #[must_use]
    pub fn end(&self) -> f32 {
        self.end
    }

    /// The segments in order, as duration in seconds and jerk in micro-units per second cubed; empty ones are left out.
    pub fn segments(&self) -> impl Iterator<Item = (f32, f32)> + '_ {
        self.segments.iter().filter(|segment| segment.duration > 0.0).map(|segment| (segment.duration, segment.jerk))
    }

    /// The state `time` seconds after the start; at rest at the exact end from the duration on.
    #[must_use]
    pub fn at(&self, time: f32) -> MotionState {
        let left = self.duration - time;
        if left <= 0.0 {
            return MotionState { offset: self.end, ..MotionState::default() };
        }
        if time <= left {
            return run(self.start, &self.segments, time);
        }
        // The second half is run backwards from rest at the end: rounding gathers in the middle, where the axis is quick,
        // and can neither overshoot the end nor jump to it. Backwards only the acceleration changes its sign.
        let back = run(MotionState::default(), self.segments.iter().rev(), left);
        MotionState { offset: self.end - back.offset, velocity: back.velocity, acceleration: -back.acceleration }
    }
}

fn total(segments: &[Segment]) -> f32 {
    segments.iter().map(|segment| segment.duration).sum()
}

fn run<'a>(start: MotionState, segments: impl IntoIterator<Item = &'a Segment>, time: f32) -> MotionState {
    let mut state = start;
    let mut left = time.max(0.0);
    for segment in segments {
        let t = left.min(segment.duration);
        let MotionState { offset, velocity, acceleration } = state;
        state = MotionState {
            offset: offset + t * (velocity + t * (acceleration / 2.0 + t * segment.jerk / 6.0)),
            velocity: velocity + t * (acceleration + t * segment.jerk / 2.0),
            acceleration: acceleration + t * segment.jerk,
        };
        left -= t;
    }
    state
}

/// The speed reached on a way of `length` between rests: the limit, or less where the way is short.
fn peak_speed(length: f32, limits: Limits) -> f32 {
    let Limits { speed, acceleration: a, jerk: j } = limits;
    let (ramp, hold) = speed_change(speed, limits);
    if length >= speed * (2.0 * ramp + hold) {
        return speed;
    }
    // Never at full acceleration: length = 2 v sqrt(v / j).
    let peak = cbrtf(length * length * j / 4.0);
    if peak * j <= a * a {
        return peak;
    }
    // With a stretch of full acceleration: length = v (v / a + a / j). Written without cancellation.
    2.0 * length / (a / j + sqrtf(a * a / (j * j) + 4.0 * length / a))
}

/// Durations of the jerk ramp and of constant acceleration that change the speed by `change`.
fn speed_change(change: f32, limits: Limits) -> (f32, f32) {
    let Limits { acceleration: a, jerk: j, .. } = limits;
    if change * j >= a * a { (a / j, (change / a - a / j).max(0.0)) } else { (sqrtf(change / j), 0.0) }
}
