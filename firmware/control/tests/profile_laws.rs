//! Laws of jerk-limited trajectories: limits kept, exact ends, optimal time, quick stops, other targets in mid-move.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vergence_control::{FINE_BITS, Fine, Limits, MotionState, Trajectory};
use vergence_protocol::Microseconds;

/// The control tick.
const TICK_US: u64 = 1_000;
const TICK: f64 = 1e-3;
/// Speed, acceleration and jerk are kept to this share.
const SHARE: f64 = 1e-3;
/// Relative rounding of single precision, in which the pieces are planned.
const EPSILON: f64 = f32::EPSILON as f64;
/// One thousandth of a micro-unit: what rounding may leave.
const THOUSANDTH: f64 = 1e-3;

fn fine(micro: f64) -> Fine {
    (micro * f64::from(1 << FINE_BITS)) as Fine
}

fn micro(fine: Fine) -> f64 {
    fine as f64 / f64::from(1 << FINE_BITS)
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

/// A motion between rests.
#[derive(Clone, Copy, Debug)]
struct Trip {
    from: Fine,
    to: Fine,
    limits: Limits,
}

impl Trip {
    fn trajectory(&self) -> Trajectory {
        Trajectory::reach(MotionState::at(self.from), self.to, self.limits, 0.0)
    }

    fn length(&self) -> f64 {
        micro(self.to - self.from).abs()
    }
}

fn any_trip() -> impl Strategy<Value = Trip> {
    let way = (-2_000_000..2_000_000i32, magnitude(1.0, 3e6), any::<bool>());
    (way, prop_oneof![3 => any_limits(), 1 => bench_limits()]).prop_map(|((from, length, back), limits)| {
        let from = fine(f64::from(from));
        let length = fine(f64::from(length.round().max(1.0)));
        Trip { from, to: if back { from - length } else { from + length }, limits }
    })
}

/// A trip, and an instant on it.
fn any_moment() -> impl Strategy<Value = (Trip, MotionState)> {
    (any_trip(), 0.0f64..1.0).prop_map(|(trip, share)| {
        let trajectory = trip.trajectory();
        let us = share * f64::from(trajectory.duration()) * 1e6;
        (trip, trajectory.state(Microseconds(us as u64)))
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
    let way = |peak: f64| peak * speed_change_time(peak, trip.limits);
    let (mut low, mut high) = (0.0, f64::from(trip.limits.speed));
    if way(high) > trip.length() {
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if way(middle) > trip.length() { high = middle } else { low = middle }
        }
    }
    let ramp = speed_change_time(high, trip.limits);
    2.0 * ramp + (trip.length() / high - ramp).max(0.0)
}

/// Ticks to look at: all of a short motion; of a long one the first, the last, and some in between.
fn ticks(duration: f32) -> Vec<u64> {
    let all = (f64::from(duration) / TICK).ceil() as u64 + 1;
    let span = 60;
    if all <= 3 * span {
        return (0..all).collect();
    }
    let between = (0..span).map(|i| span + i * (all - 2 * span) / span);
    (0..span).chain(between).chain(all - span..all).collect()
}

/// Checks the limits, and that each quantity is the integral of the next.
fn check(trajectory: &Trajectory, limits: Limits) -> Result<(), TestCaseError> {
    let [v_max, a_max, j_max] = [limits.speed, limits.acceleration, limits.jerk].map(f64::from);
    for tick in ticks(trajectory.duration()) {
        let at = |tick: u64| {
            let MotionState { position, velocity, acceleration } = trajectory.state(Microseconds(tick * TICK_US));
            [micro(position), micro(velocity), micro(acceleration)]
        };
        let ([p0, v0, a0], [p1, v1, a1]) = (at(tick), at(tick + 1));
        prop_assert!(v0.abs() <= v_max * (1.0 + SHARE), "speed {v0} of {v_max}");
        prop_assert!(a0.abs() <= a_max * (1.0 + SHARE), "acceleration {a0} of {a_max}");
        // Single precision plans when a piece ends; it may end there with a hundred millionth of the limit left over.
        let [v_left, a_left] = [8.0 * EPSILON * v_max + 1e-2, 8.0 * EPSILON * a_max + 1e-2];
        prop_assert!((a1 - a0).abs() <= j_max * TICK * (1.0 + SHARE) + a_left, "jerk: {a0} to {a1}");
        // The trapezoid rule errs by at most L dt²/4 where the integrand changes by at most L a second.
        let gained = 0.5 * (a0 + a1) * TICK;
        prop_assert!((v1 - v0 - gained).abs() <= 0.26 * j_max * TICK * TICK + v_left, "{v0} to {v1}: {gained}");
        let moved = 0.5 * (v0 + v1) * TICK;
        let smooth = 0.26 * a_max * TICK * TICK + v_left * TICK + THOUSANDTH;
        prop_assert!((p1 - p0 - moved).abs() <= smooth, "{p0} to {p1}: {moved}");
    }
    Ok(())
}

/// At rest at the very target.
fn check_end(trajectory: &Trajectory, target: Fine) -> Result<(), TestCaseError> {
    let end = Microseconds(trajectory.ends().0 + 1);
    prop_assert_eq!(trajectory.state(end), MotionState::at(target));
    prop_assert!(trajectory.is_over(end));
    Ok(())
}

proptest! {
    #![proptest_config(seeded(100_000))]

    #[test]
    fn a_move_keeps_its_limits_and_ends_exactly(trip in any_trip()) {
        let trajectory = trip.trajectory();
        prop_assert_eq!(trajectory.state(Microseconds(0)), MotionState::at(trip.from));
        check(&trajectory, trip.limits)?;
        check_end(&trajectory, trip.to)?;
    }

    #[test]
    fn another_target_in_mid_move_keeps_the_limits_and_is_reached_exactly(
        (trip, from) in any_moment(), target in -3_000_000..3_000_000i32, share in 0.05f32..1.0,
    ) {
        let limits = Limits { speed: trip.limits.speed * share, ..trip.limits };
        let target = fine(f64::from(target));
        let trajectory = Trajectory::reach(from, target, limits, 0.0);
        prop_assert_eq!(trajectory.state(Microseconds(0)), from);
        check(&trajectory, trip.limits)?;
        check_end(&trajectory, target)?;
        // Never longer than to stop and to go from there.
        let stop = Trajectory::stop(from, trip.limits);
        let again = Trajectory::reach(MotionState::at(stop.target()), target, limits, 0.0);
        let bound = stop.duration() + again.duration();
        prop_assert!(trajectory.duration() <= bound * 1.0001 + 0.005, "{} of {bound} s", trajectory.duration());
    }

    #[test]
    fn a_stop_in_mid_move_keeps_the_limits_and_never_passes_the_target((trip, from) in any_moment()) {
        let stop = Trajectory::stop(from, trip.limits);
        prop_assert_eq!(stop.state(Microseconds(0)), from);
        check(&stop, trip.limits)?;
        check_end(&stop, stop.target())?;
        let sign = (trip.to - trip.from).signum() as f64;
        let left = sign * micro(trip.to - from.position);
        let needed = sign * micro(stop.target() - from.position);
        let rounding = 8.0 * EPSILON * trip.length() + THOUSANDTH;
        prop_assert!(needed <= left + rounding, "needs {needed}, has {left}");
        prop_assert!(needed >= -rounding, "turns back by {needed}");
        // While speeding up the acceleration must first be taken back: a/j more than from constant speed.
        let [v, a, j] = [trip.limits.speed, trip.limits.acceleration, trip.limits.jerk].map(f64::from);
        let bound = v / a + 2.0 * a / j;
        prop_assert!(f64::from(stop.duration()) <= bound * (1.0 + SHARE), "{} of {bound} s", stop.duration());
    }
}

proptest! {
    #![proptest_config(seeded(20_000))]

    #[test]
    fn a_move_takes_the_shortest_time(trip in any_trip()) {
        let (duration, shortest) = (f64::from(trip.trajectory().duration()), shortest_time(&trip));
        prop_assert!((duration / shortest - 1.0).abs() < 2e-5, "{duration} s instead of {shortest} s");
    }

    #[test]
    fn a_move_never_turns_back(trip in any_trip()) {
        let trajectory = trip.trajectory();
        let sign = (trip.to - trip.from).signum();
        let mut last = 0.0;
        for tick in ticks(trajectory.duration()) {
            let along = micro(sign * (trajectory.state(Microseconds(tick * TICK_US)).position - trip.from));
            prop_assert!(along >= last - THOUSANDTH, "from {last} to {along} in tick {tick}");
            last = along;
        }
    }

    #[test]
    fn a_slower_move_takes_the_time_it_is_given(trip in any_trip(), factor in 1.0f32..100.0) {
        prop_assume!(trip.limits.jerk > 0.01 * factor.powi(3));
        let own = trip.trajectory().duration();
        let slower = Trajectory::reach(MotionState::at(trip.from), trip.to, trip.limits, own * factor);
        prop_assert!((slower.duration() / (own * factor) - 1.0).abs() < 2e-5, "{} of {}", slower.duration(), own * factor);
        check(&slower, trip.limits.scaled(1.001 / factor))?;
        check_end(&slower, trip.to)?;
    }

    #[test]
    fn another_target_is_reached_no_sooner_than_asked_for(
        (trip, from) in any_moment(), target in -3_000_000..3_000_000i32, factor in 1.0f32..20.0,
    ) {
        prop_assume!(trip.limits.jerk > 0.01 * factor.powi(3));
        let target = fine(f64::from(target));
        let quickest = Trajectory::reach(from, target, trip.limits, 0.0).duration();
        let slower = Trajectory::reach(from, target, trip.limits, quickest * factor);
        prop_assert!(slower.duration() >= quickest * factor * (1.0 - 1e-4), "{} s", slower.duration());
        check(&slower, trip.limits)?;
        check_end(&slower, target)?;
    }

    #[test]
    fn the_same_target_again_changes_nothing((trip, from) in any_moment()) {
        let trajectory = Trajectory::reach(from, trip.to, trip.limits, 0.0);
        let whole = trip.trajectory().duration();
        prop_assert!(trajectory.duration() <= whole * 1.01 + 0.02, "{} of {whole} s", trajectory.duration());
        check(&trajectory, trip.limits)?;
    }

    #[test]
    fn a_stop_comes_to_rest_from_any_state(limits in any_limits(), speed in -1.0f32..1.0, push in -1.0f32..1.0) {
        let [velocity, acceleration] = [speed * limits.speed, push * limits.acceleration].map(|rate| fine(rate.into()));
        let stop = Trajectory::stop(MotionState { position: 0, velocity, acceleration }, limits);
        // Pushed on at full speed nothing can keep the speed limit: the push must be taken back first.
        let [v, a, j] = [limits.speed, limits.acceleration, limits.jerk].map(f64::from);
        check(&stop, Limits { speed: (v + a * a / j) as f32, ..limits })?;
        check_end(&stop, stop.target())?;
    }

    #[test]
    fn a_stop_from_within_a_stop_changes_nothing((trip, from) in any_moment(), again in 0.0f64..1.0) {
        let first = Trajectory::stop(from, trip.limits);
        let state = first.state(Microseconds((again * f64::from(first.duration()) * 1e6) as u64));
        let second = Trajectory::stop(state, trip.limits);
        let apart = micro(second.target() - first.target()).abs();
        let way = micro(first.target() - from.position).abs();
        prop_assert!(apart <= 1e-5 * way + 10.0 * THOUSANDTH, "{apart} of {way}");
    }
}

#[test]
fn a_way_of_nothing_takes_no_time() {
    let limits = Limits { speed: 80_000.0, acceleration: 400_000.0, jerk: 8_000_000.0 };
    let here = MotionState::at(fine(7.0));
    for trajectory in [Trajectory::reach(here, here.position, limits, 1.0), Trajectory::stop(here, limits)] {
        assert!(trajectory.duration() <= 0.0 && trajectory.is_over(Microseconds(0)));
        assert_eq!(trajectory.state(Microseconds(0)), here);
    }
}

/// v = 80 mm/s, a = 400 mm/s², j = 8 m/s³ over 85 mm: d/v + v/a + a/j = 1.0625 + 0.2 + 0.05 s.
#[test]
fn a_long_way_takes_distance_by_speed_and_one_speed_change() {
    let limits = Limits { speed: 80_000.0, acceleration: 400_000.0, jerk: 8_000_000.0 };
    let trajectory = Trajectory::reach(MotionState::at(0), fine(85_000.0), limits, 0.0);
    assert!((trajectory.duration() - 1.3125).abs() < 1e-5, "{}", trajectory.duration());
}

/// Found by a law with another seed: an axis that brakes to a few micro-units before its target, and creeps over them for half a minute, was
/// there a fifth sooner than asked for.
#[test]
fn a_creeping_axis_is_not_there_before_the_others() {
    let limits = Limits { speed: 127_281.09, acceleration: 26_223.906, jerk: 186_598_820.0 };
    let from = MotionState { position: -3_202_108_624_625, velocity: 2_135_415_284_960, acceleration: 0 };
    let target = fine(118_052.0);
    let quickest = Trajectory::reach(from, target, limits, 0.0).duration();
    let slower = Trajectory::reach(from, target, limits, quickest * 7.94594);
    assert!(slower.duration() >= quickest * 7.94594 * (1.0 - 1e-4), "{} s", slower.duration());
    assert_eq!(slower.state(slower.ends()), MotionState::at(target));
}
