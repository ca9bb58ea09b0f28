//! The planner: jerk-limited motions from any state to rest at a target, and the quickest stop.
//!
//! L. Biagiotti and C. Melchiorri, *Trajectory Planning for Automatic Machines and Robots*, 2008, §3.4 (double S): change
//! the velocity to that of the cruise, cruise, change it to rest. Planned in single precision, since the microcontroller
//! has a single-precision FPU; the pieces are then joined in integers, and what single precision got wrong is put into
//! the cruise.

use libm::{fabsf, sqrtf};

use crate::trajectory::{Fine, MotionState, Segment, Trajectory, fine, micro, ticks};

/// Number of halvings of an interval of speeds: single precision has no more bits.
const HALVINGS: u32 = 26;
/// Share of all distances that is left for the cruise, and by which a cruise from rest is planned slower, so that rounding in
/// single precision cannot make its length negative.
const RESERVE: f32 = 2e-6;
/// Smallest jerk, in micro-units per second cubed, that the pieces represent to a ten-thousandth. A motion that would need
/// less ends early.
const LEAST_JERK: f32 = 1e-3;
/// Smallest speed of a cruise as a share of the largest speed: rounding of a change of speed leaves far less.
const LEAST_CRUISE: f32 = 4e-6;
/// A difference of speeds below this share of the speeds is rounding.
const NOTHING: f32 = 3e-7;

/// Limits of an axis, in micro-units per second, per second squared and per second cubed. All are positive.
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

impl Trajectory {
    /// The quickest motion from `from` to rest.
    #[must_use]
    pub fn stop(from: MotionState, limits: Limits) -> Self {
        let change = Change::between(micro(from.velocity), micro(from.acceleration), 0.0, limits);
        let mut stop = Self::resting_at(from.position);
        let end = change.run(from, |segment| stop.push(segment));
        stop.rest_at(end.position);
        stop
    }

    /// The quickest motion from `from` to rest at `target` that takes at least `at_least` seconds. A motion that cannot take
    /// exactly that long takes longer; one that creeps over a few micro-units, whose time single precision does not tell, rests at its end.
    #[must_use]
    pub fn reach(from: MotionState, target: Fine, limits: Limits, at_least: f32) -> Self {
        let mut whole = Self::moving(from, target, limits, at_least);
        if whole.duration() > 0.0 {
            whole.rest_until(at_least);
        }
        whole
    }

    /// As [`Self::reach`], but the motion alone.
    fn moving(from: MotionState, target: Fine, limits: Limits, at_least: f32) -> Self {
        if from.is_rest() {
            return Self::from_rest(from.position, target, limits, at_least);
        }
        let mut halting = Self::stop(from, limits);
        let rest = Self::from_rest(halting.target(), target, limits, at_least - halting.duration());
        halting.append(&rest);
        let way = Way::new(from, target, limits);
        let cruising = way.cruise_lasting(at_least).map(|speed| Self::cruising(from, target, way.sign * speed, limits));
        // To a target just beyond its stop, an axis is quicker when it stops first than when it creeps on.
        cruising.filter(|cruising| cruising.duration() <= halting.duration()).unwrap_or(halting)
    }

    /// As [`Self::reach`], but the last `run_up` of the way comes from below, within the limits `last`, so that play is taken
    /// up on the same side.
    #[must_use]
    pub fn reach_from_below(
        from: MotionState,
        (target, run_up): (Fine, Fine),
        [limits, last]: [Limits; 2],
        at_least: f32,
    ) -> Self {
        let last = Self::reach(MotionState::at(target - run_up), target, last, 0.0);
        let mut whole = Self::reach(from, target - run_up, limits, at_least - last.duration());
        whole.append(&last);
        whole
    }

    /// A motion from rest; for a longer duration the same path is run slower.
    fn from_rest(position: Fine, target: Fine, limits: Limits, at_least: f32) -> Self {
        let distance = micro(target - position);
        let length = fabsf(distance);
        let peak = peak_speed(length, limits);
        if peak <= 0.0 {
            return Self::resting_at(target);
        }
        let quickest = length / peak + Change::between(0.0, 0.0, peak, limits).duration();
        let slowed = if at_least > quickest { quickest / at_least } else { 1.0 };
        let slowed = slowed.max(cube_root(LEAST_JERK / limits.jerk)).min(1.0);
        let cruise = if distance < 0.0 { -peak } else { peak } * slowed * (1.0 - RESERVE);
        Self::cruising(MotionState::at(position), target, cruise, limits.scaled(slowed))
    }

    /// A motion that changes to the velocity `cruise`, keeps it as long as necessary, and comes to rest.
    fn cruising(from: MotionState, target: Fine, cruise: f32, limits: Limits) -> Self {
        let mut whole = Self::resting_at(target);
        let speeding = Change::between(micro(from.velocity), micro(from.acceleration), cruise, limits);
        let top = speeding.run(from, |segment| whole.push(segment));
        // Slowing down is planned as speeding up, backwards from rest at the target, so that rounding errors collect where
        // the axis is fast.
        let mut slowing = Self::resting_at(0);
        let far =
            Change::between(0.0, 0.0, micro(top.velocity), limits).run(MotionState::default(), |s| slowing.push(s));
        let way = target - far.position - top.position;
        if top.velocity != 0 {
            let duration = (i128::from(way) << 32) / i128::from(top.velocity);
            let duration = i64::try_from(duration.max(0)).unwrap_or(i64::MAX / 4);
            whole.push(Segment { start: MotionState { acceleration: 0, ..top }, jerk: 0, duration });
        }
        slowing.backwards(target).for_each(|segment| whole.push(segment));
        whole
    }
}

/// A change of velocity to zero acceleration in the least time: jerk, hold, jerk back.
#[derive(Clone, Copy, Debug)]
struct Change {
    from: [f32; 2],
    jerk: f32,
    durations: [f32; 3],
}

impl Change {
    /// From velocity and acceleration to the velocity `to`.
    fn between(velocity: f32, acceleration: f32, to: f32, limits: Limits) -> Self {
        let Limits { acceleration: a_max, jerk: j, .. } = limits;
        // What is left to do once the acceleration alone has been brought to zero. Where that is nothing but rounding,
        // nothing else is done: half a root of it would be much.
        let alone = acceleration * fabsf(acceleration) / (2.0 * j);
        let remaining = to - (velocity + alone);
        let is_rounding = fabsf(remaining) <= NOTHING * (fabsf(to) + fabsf(velocity) + fabsf(alone));
        if is_rounding {
            let jerk = if acceleration < 0.0 { -j } else { j };
            let durations = [0.0, 0.0, fabsf(acceleration) / j];
            return Self { from: [velocity, acceleration], jerk, durations };
        }
        // Mirrored so that the velocity must be raised: the acceleration climbs to a peak, holds, and returns.
        let sign = if remaining < 0.0 { -1.0 } else { 1.0 };
        let (change, a) = (sign * (to - velocity), sign * acceleration);
        let peak = sqrtf((change * j + 0.5 * a * a).max(0.0)).min(a_max).max(a);
        let gained = (2.0 * peak * peak - a * a) / (2.0 * j);
        let hold = if peak > 0.0 { ((change - gained) / peak).max(0.0) } else { 0.0 };
        Self { from: [velocity, acceleration], jerk: sign * j, durations: [(peak - a) / j, hold, peak / j] }
    }

    fn pieces(&self) -> [(f32, f32); 3] {
        let [up, hold, down] = self.durations;
        [(up, self.jerk), (hold, 0.0), (down, -self.jerk)]
    }

    fn duration(&self) -> f32 {
        self.durations.iter().sum()
    }

    fn distance(&self) -> f32 {
        let [mut v, mut a] = self.from;
        let mut x = 0.0;
        for (t, j) in self.pieces() {
            x += t * (v + t * (a / 2.0 + t * j / 6.0));
            v += t * (a + t * j / 2.0);
            a += t * j;
        }
        x
    }

    /// The pieces from `state` on; returns its end.
    fn run(&self, mut state: MotionState, mut push: impl FnMut(Segment)) -> MotionState {
        for (duration, jerk) in self.pieces() {
            let segment = Segment { start: state, jerk: fine(jerk), duration: ticks(duration) };
            push(segment);
            state = segment.end();
        }
        state
    }
}

/// A way that begins in motion, mirrored so that it goes on upwards from where the quickest stop would end.
#[derive(Clone, Copy, Debug)]
struct Way {
    sign: f32,
    length: f32,
    velocity: f32,
    acceleration: f32,
    limits: Limits,
}

impl Way {
    fn new(from: MotionState, target: Fine, limits: Limits) -> Self {
        let (length, velocity, acceleration) =
            (micro(target - from.position), micro(from.velocity), micro(from.acceleration));
        let stop = Change::between(velocity, acceleration, 0.0, limits).distance();
        let sign = if length < stop { -1.0 } else { 1.0 };
        Self { sign, length: sign * length, velocity: sign * velocity, acceleration: sign * acceleration, limits }
    }

    /// How long a motion takes that cruises at `speed`; `None` where it would go too far.
    fn duration(&self, speed: f32) -> Option<f32> {
        let up = Change::between(self.velocity, self.acceleration, speed, self.limits);
        let down = Change::between(0.0, 0.0, speed, self.limits);
        let [above, below] = [up.distance(), down.distance()];
        let left = self.length - above - below;
        let rounding = RESERVE * (fabsf(self.length) + fabsf(above) + below);
        (left >= rounding).then(|| up.duration() + down.duration() + left / speed)
    }

    fn is_possible(&self, speed: f32) -> bool {
        self.duration(speed).is_some()
    }

    /// The quickest cruise. Above the speed that is left when the acceleration alone is brought to zero the way grows
    /// with the speed; below it the axis brakes twice, and a feasible speed is found from below.
    fn quickest(&self) -> Option<f32> {
        let fastest = self.limits.speed;
        if self.is_possible(fastest) {
            return Some(fastest);
        }
        let a = self.acceleration;
        // Not clamp: its panic would print floats, which takes 12 KiB of a small board's flash.
        let flat = (self.velocity + a * fabsf(a) / (2.0 * self.limits.jerk)).max(0.0).min(fastest);
        let [low, high] = if flat > 0.0 && self.is_possible(flat) { [flat, fastest] } else { [0.0, flat] };
        let high = if high > 0.0 { high } else { fastest };
        let speed = halve(low, high, |speed| self.is_possible(speed));
        (speed > 0.0).then_some(speed)
    }

    /// The quickest cruise that makes the whole last `at_least` so long.
    fn cruise_lasting(&self, at_least: f32) -> Option<f32> {
        let quickest = self.quickest()?;
        let is_slow = |speed: f32| self.duration(speed).is_some_and(|duration| duration >= at_least);
        let speed = if is_slow(quickest) { quickest } else { halve(0.0, quickest, is_slow) };
        (speed > LEAST_CRUISE * self.limits.speed).then_some(speed)
    }
}

/// The end of `low..high` at which `holds` ends to hold, from the side where it does.
fn halve(mut low: f32, mut high: f32, holds: impl Fn(f32) -> bool) -> f32 {
    for _ in 0..HALVINGS {
        let middle = f32::midpoint(low, high);
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

/// The speed reached on a way of `length` between rests: the limit, or less where the way is short.
fn peak_speed(length: f32, limits: Limits) -> f32 {
    let Limits { speed, acceleration: a, jerk: j } = limits;
    if length >= speed * Change::between(0.0, 0.0, speed, limits).duration() {
        return speed;
    }
    // Never at full acceleration: length = 2 v sqrt(v / j).
    let peak = cube_root(length * length * j / 4.0);
    if peak * j <= a * a {
        return peak;
    }
    // With a stretch of full acceleration: length = v (v / a + a / j). Written without cancellation.
    2.0 * length / (a / j + sqrtf(a * a / (j * j) + 4.0 * length / a))
}

/// The cube root of a number that is not negative. `libm`'s goes through double precision, which a core without it pays
/// for with 3 KiB of flash.
fn cube_root(x: f32) -> f32 {
    if x < f32::MIN_POSITIVE {
        return 0.0;
    }
    // A third of the exponent is good to 5 %, and each of Halley's steps triples the digits.
    let mut root = f32::from_bits(x.to_bits() / 3 + 0x2A51_19F2);
    for _ in 0..3 {
        let cube = root * root * root;
        root -= root * (cube - x) / (2.0 * cube + x);
    }
    root
}
