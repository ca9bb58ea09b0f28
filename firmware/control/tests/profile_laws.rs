//! Laws of jerk-limited profiles: limits kept, exact ends, optimal time, quick stops.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vergence_control::{Limits, MotionState, Profile};

/// The control tick, in seconds.
const TICK: f64 = 1e-3;
/// Speed, acceleration and jerk are kept to this share.
const SHARE: f64 = 1e-3;
/// Relative rounding of single precision.
const EPSILON: f64 = f32::EPSILON as f64;

/// A motion from rest to rest, in whole micro-units.
#[derive(Clone, Copy, Debug)]
struct Trip {
    distance: f32,
    limits: Limits,
}

impl Trip {
    fn profile(&self) -> Profile {
        Profile::rest_to_rest(self.distance, self.limits)
    }

    /// What single precision may do to a position: several roundings of the largest offset.
    fn position_rounding(&self) -> f64 {
        8.0 * EPSILON * f64::from(self.distance.abs()) + 1e-5
    }
}

/// Numbers evenly spread over the orders of magnitude.
fn magnitude(low: f64, high: f64) -> impl Strategy<Value = f32> {
    (low.ln()..high.ln()).prop_map(|ln| ln.exp() as f32)
}

fn any_limits() -> impl Strategy<Value = Limits> {
    (magnitude(1e3, 2e6), magnitude(1e4, 1e7), magnitude(1e5, 2e8)).prop_map(|(speed, acceleration, jerk)| Limits {
        speed,
        acceleration,
        jerk,
    })
}

/// The two axes of a bench: a linear one in micrometres, a rotary one in microradians.
fn bench_limits() -> impl Strategy<Value = Limits> {
    let linear = Limits { speed: 80_000.0, acceleration: 400_000.0, jerk: 8_000_000.0 };
    let rotary = Limits { speed: 1_047_198.0, acceleration: 4_188_790.0, jerk: 69_813_170.0 };
    let share = (1u16..=1000).prop_map(|permille| f32::from(permille) / 1000.0);
    (prop_oneof![Just(linear), Just(rotary)], share).prop_map(|(limits, share)| limits.scaled(share))
}

fn any_trip() -> impl Strategy<Value = Trip> {
    let distance = (magnitude(1.0, 3e6), any::<bool>());
    (distance, prop_oneof![3 => any_limits(), 1 => bench_limits()]).prop_map(|((length, back), limits)| {
        let length = length.round().max(1.0);
        Trip { distance: if back { -length } else { length }, limits }
    })
}

/// The same cases in every run.
fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(0x5eed), failure_persistence: None, ..ProptestConfig::default() }
}

/// Time to change the speed by `change`, from and to zero acceleration.
fn speed_change_time(change: f64, limits: Limits) -> f64 {
    let (a, j) = (f64::from(limits.acceleration), f64::from(limits.jerk));
    if change >= a * a / j { change / a + a / j } else { 2.0 * (change / j).sqrt() }
}

/// The shortest time from rest to rest, by bisection over the peak speed: the way grows with it.
fn shortest_time(trip: &Trip) -> f64 {
    let length = f64::from(trip.distance.abs());
    let way = |peak: f64| peak * speed_change_time(peak, trip.limits);
    let (mut low, mut high) = (0.0, f64::from(trip.limits.speed));
    if way(high) > length {
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if way(middle) > length { high = middle } else { low = middle }
        }
    }
    let ramp = speed_change_time(high, trip.limits);
    2.0 * ramp + (length / high - ramp).max(0.0)
}

/// Starts of ticks: all of a short motion; of a long one the first, the last, and some in between.
fn ticks(duration: f64) -> Vec<f64> {
    let all = (duration / TICK).ceil() as usize;
    let span = 120;
    let at = |tick: usize| tick as f64 * TICK;
    if all <= 3 * span {
        return (0..all).map(at).collect();
    }
    let between = (0..span).map(|i| span + i * (all - 2 * span) / span);
    (0..span).chain(between).chain(all - span..all).map(at).collect()
}

/// How far a profile's own numbers may stray.
struct Rounding {
    position: f64,
    velocity: f64,
    acceleration: f64,
}

/// Checks one tick: limits, and that each quantity is the integral of the next.
fn check_tick(from: MotionState, to: MotionState, limits: Limits, rounding: &Rounding) -> Result<(), TestCaseError> {
    let Limits { speed, acceleration, jerk } = limits;
    let (v_max, a_max, j_max) = (f64::from(speed), f64::from(acceleration), f64::from(jerk));
    let [p0, v0, a0] = [from.offset, from.velocity, from.acceleration].map(f64::from);
    let [p1, v1, a1] = [to.offset, to.velocity, to.acceleration].map(f64::from);
    prop_assert!(v0.abs() <= v_max * (1.0 + SHARE), "speed {v0}");
    prop_assert!(a0.abs() <= a_max * (1.0 + SHARE), "acceleration {a0}");
    prop_assert!((a1 - a0).abs() <= j_max * TICK * (1.0 + SHARE) + rounding.acceleration, "jerk: {a0} to {a1}");
    prop_assert!((v1 - v0).abs() <= a_max * TICK * (1.0 + SHARE) + rounding.velocity, "velocity: {v0} to {v1}");
    // The trapezoid rule errs by at most L dt²/4 where the integrand changes by at most L a second.
    let gained = 0.5 * (a0 + a1) * TICK;
    prop_assert!((v1 - v0 - gained).abs() <= 0.25 * j_max * TICK * TICK + rounding.velocity, "{v0} to {v1}: {gained}");
    let moved = 0.5 * (v0 + v1) * TICK;
    prop_assert!((p1 - p0 - moved).abs() <= 0.25 * a_max * TICK * TICK + rounding.position, "{p0} to {p1}: {moved}");
    Ok(())
}

/// The instants at both ends of a tick are themselves rounded, and the quantities change in between.
fn rounding(limits: Limits, duration: f64, position: f64) -> Rounding {
    let instant = 2.0 * duration * EPSILON;
    let [v, a, j] = [limits.speed, limits.acceleration, limits.jerk].map(f64::from);
    Rounding {
        position: position + instant * v,
        velocity: 4.0 * EPSILON * v + instant * a + 1e-3,
        acceleration: 4.0 * EPSILON * a + instant * j,
    }
}

fn check_limits(profile: &Profile, limits: Limits, position_rounding: f64) -> Result<(), TestCaseError> {
    let duration = f64::from(profile.duration());
    let rounding = rounding(limits, duration, position_rounding);
    for start in ticks(duration) {
        let (from, to) = (profile.at(start as f32), profile.at((start + TICK) as f32));
        check_tick(from, to, limits, &rounding)?;
    }
    Ok(())
}

fn at_rest(state: MotionState) -> bool {
    state == MotionState { offset: state.offset, ..MotionState::default() }
}

proptest! {
    #![proptest_config(seeded(20_000))]

    #[test]
    fn rest_to_rest_keeps_its_limits(trip in any_trip()) {
        check_limits(&trip.profile(), trip.limits, trip.position_rounding())?;
    }

    #[test]
    fn rest_to_rest_ends_exactly_at_the_distance_at_rest(trip in any_trip(), later in 0.0f32..10.0) {
        let profile = trip.profile();
        let end = profile.at(profile.duration() + later);
        prop_assert_eq!(end.offset.to_bits(), trip.distance.to_bits());
        prop_assert_eq!(profile.end().to_bits(), trip.distance.to_bits());
        prop_assert!(at_rest(end));
        prop_assert_eq!(profile.at(0.0).offset.to_bits(), 0.0f32.to_bits());
        prop_assert!(profile.at(0.0).velocity.abs() < f32::MIN_POSITIVE);
    }

    #[test]
    fn rest_to_rest_takes_the_shortest_time(trip in any_trip()) {
        let (duration, shortest) = (f64::from(trip.profile().duration()), shortest_time(&trip));
        prop_assert!((duration / shortest - 1.0).abs() < 1e-5, "{duration} s instead of {shortest} s");
    }

    #[test]
    fn rest_to_rest_never_turns_back(trip in any_trip()) {
        let profile = trip.profile();
        let sign = trip.distance.signum();
        let mut last = 0.0;
        for start in ticks(f64::from(profile.duration())) {
            let along = sign * profile.at(start as f32).offset;
            prop_assert!(along >= last, "from {last} to {along} at {start} s");
            last = along;
        }
        prop_assert!(sign * trip.distance >= last, "end {}, before it {last}", trip.distance);
    }

    #[test]
    fn a_stop_keeps_the_limits_and_never_passes_the_target(trip in any_trip(), share in 0.0f32..1.0) {
        let profile = trip.profile();
        let state = profile.at(share * profile.duration());
        let stop = Profile::stop(state.velocity, state.acceleration, trip.limits);
        check_limits(&stop, trip.limits, trip.position_rounding())?;
        prop_assert!(at_rest(stop.at(stop.duration())));
        let sign = f64::from(trip.distance.signum());
        let left = sign * (f64::from(trip.distance) - f64::from(state.offset));
        let needed = sign * f64::from(stop.end());
        prop_assert!(needed <= left + trip.position_rounding(), "needs {needed}, has {left}");
        prop_assert!(needed >= -trip.position_rounding(), "turns back by {needed}");
    }

    #[test]
    fn a_stop_takes_no_longer_than_the_bound(trip in any_trip(), share in 0.0f32..1.0) {
        let profile = trip.profile();
        let state = profile.at(share * profile.duration());
        let stop = Profile::stop(state.velocity, state.acceleration, trip.limits);
        // While speeding up the acceleration must first be taken back: a/j more than from constant speed.
        let [v, a, j] = [trip.limits.speed, trip.limits.acceleration, trip.limits.jerk].map(f64::from);
        let bound = v / a + 2.0 * a / j;
        prop_assert!(f64::from(stop.duration()) <= bound * (1.0 + SHARE), "{} of {bound} s", stop.duration());
    }

    #[test]
    fn a_stop_comes_to_rest_from_any_state(limits in any_limits(), speed in -1.0f32..1.0, push in -1.0f32..1.0) {
        let (velocity, acceleration) = (speed * limits.speed, push * limits.acceleration);
        let stop = Profile::stop(velocity, acceleration, limits);
        // Pushed on at full speed nothing can keep the speed limit: the push must be taken back first.
        let [v, a, j] = [limits.speed, limits.acceleration, limits.jerk].map(f64::from);
        let faster = Limits { speed: (v + a * a / j) as f32, ..limits };
        let length = f64::from(stop.duration()) * f64::from(faster.speed);
        check_limits(&stop, faster, 8.0 * EPSILON * length + 1e-5)?;
        prop_assert!(at_rest(stop.at(stop.duration())));
    }

    #[test]
    fn a_stop_from_within_a_stop_changes_nothing(trip in any_trip(), when in 0.0f32..1.0, again in 0.0f32..1.0) {
        let profile = trip.profile();
        let state = profile.at(when * profile.duration());
        let first = Profile::stop(state.velocity, state.acceleration, trip.limits);
        let state = first.at(again * first.duration());
        let second = Profile::stop(state.velocity, state.acceleration, trip.limits);
        let (at_once, in_two) = (f64::from(first.end()), f64::from(state.offset) + f64::from(second.end()));
        prop_assert!((at_once - in_two).abs() <= trip.position_rounding() + 1e-5 * at_once.abs(), "{at_once}, {in_two}");
    }

    #[test]
    fn axes_that_start_together_finish_at_the_same_instant(trips in (any_trip(), any_trip())) {
        let planned = [trips.0.profile(), trips.1.profile()];
        let slowest = planned[0].duration().max(planned[1].duration());
        for (profile, trip) in planned.into_iter().zip([trips.0, trips.1]) {
            let together = profile.lasting(slowest);
            prop_assert_eq!(together.duration().to_bits(), slowest.to_bits());
            prop_assert_eq!(together.at(slowest).offset.to_bits(), trip.distance.to_bits());
            let slower = trip.limits.scaled(profile.duration() / slowest);
            check_limits(&together, slower, trip.position_rounding())?;
        }
    }

    #[test]
    fn stretching_keeps_the_path_through_time(trip in any_trip(), factor in 1.0f32..1000.0, share in 0.0f32..1.0) {
        let (own, stretched) = (trip.profile(), trip.profile().stretched(factor));
        let (wanted, got) = (f64::from(own.duration()) * f64::from(factor), f64::from(stretched.duration()));
        prop_assert!((got / wanted - 1.0).abs() < 1e-6, "{got} s instead of {wanted} s");
        prop_assert_eq!(stretched.at(stretched.duration()).offset.to_bits(), trip.distance.to_bits());
        let (here, there) = (own.at(share * own.duration()), stretched.at(share * stretched.duration()));
        let apart = f64::from(here.offset) - f64::from(there.offset);
        let moved = f64::from(own.duration()) * EPSILON * f64::from(trip.limits.speed);
        prop_assert!(apart.abs() <= 2.0 * trip.position_rounding() + 4.0 * moved, "apart by {apart}");
        check_limits(&stretched, trip.limits.scaled(1.0 / factor), trip.position_rounding())?;
    }
}

#[test]
fn a_way_of_nothing_takes_no_time() {
    let limits = Limits { speed: 80_000.0, acceleration: 400_000.0, jerk: 8_000_000.0 };
    for profile in [Profile::rest_to_rest(0.0, limits), Profile::stop(0.0, 0.0, limits)] {
        assert!(profile.duration().abs() < f32::MIN_POSITIVE);
        assert!(at_rest(profile.at(0.0)) && profile.end().abs() < f32::MIN_POSITIVE);
    }
}

/// v = 80 mm/s, a = 400 mm/s², j = 8 m/s³ over 85 mm: d/v + v/a + a/j = 1.0625 + 0.2 + 0.05 s.
#[test]
fn a_long_way_takes_distance_by_speed_and_one_speed_change() {
    let limits = Limits { speed: 80_000.0, acceleration: 400_000.0, jerk: 8_000_000.0 };
    let profile = Profile::rest_to_rest(85_000.0, limits);
    assert!((profile.duration() - 1.3125).abs() < 1e-5, "{}", profile.duration());
}
