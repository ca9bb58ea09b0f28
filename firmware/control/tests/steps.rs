//! Every step on the instant at which the trajectory asks for it, up to 100 000 a second.

mod support;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use support::{HOST, TICK_US, World, linear, rotary};
use vergence_control::{AxisSettings, FINE_BITS, Fine, LARGEST_STEP_RATE, Limits, MotionState, Trajectory, plan_ticks};
use vergence_protocol::{ControllerState, Request, Status, StopKind};

const FINE: f64 = (1 << FINE_BITS) as f64;
/// What rounding of a position in single precision within a tick may hide of a mark, in steps.
const ROUNDING: f64 = 1e-5;

/// The trajectories that the first axis should run, each from its instant on.
struct Ideal {
    pieces: Vec<(u64, Trajectory)>,
    rest: Fine,
}

impl Ideal {
    fn state(&self, us: u64) -> MotionState {
        let piece = self.pieces.iter().rev().find(|(start, _)| *start <= us);
        piece.map_or(MotionState::at(self.rest), |(start, trajectory)| {
            trajectory.state(vergence_protocol::Microseconds(us - start))
        })
    }

    fn position(&self, us: u64) -> f64 {
        self.state(us).position as f64 / FINE
    }

    /// The position at a nanosecond, between those at the microseconds.
    fn between(&self, ns: u64) -> f64 {
        let (us, rest) = (ns / 1_000, (ns % 1_000) as f64 * 1e-3);
        self.position(us) * (1.0 - rest) + self.position(us + 1) * rest
    }

    /// The instant at which the next order begins.
    fn next(world: &World) -> u64 {
        world.now.0 / TICK_US * TICK_US + 2 * TICK_US
    }

    /// Goes on to another trajectory once it is planned; where another one is still being planned, that one begins first.
    fn go_to(&mut self, world: &World, plan: impl FnOnce(MotionState) -> Trajectory) {
        let asked = Self::next(world).max(self.pieces.last().map_or(0, |(start, _)| *start));
        let start = asked + u64::from(plan_ticks(1)) * TICK_US;
        let trajectory = plan(self.state(start));
        self.pieces.push((start, trajectory));
    }

    /// Stops at once; what is still being planned never begins.
    fn stop(&mut self, world: &World, limits: Limits) {
        let start = Self::next(world);
        self.pieces.retain(|(begins, _)| *begins <= start);
        let trajectory = Trajectory::stop(self.state(start), limits);
        self.pieces.push((start, trajectory));
    }

    /// Whether the motor turns round within a millisecond of `us`: then the step may be as late as that.
    fn turns_round(&self, us: u64) -> bool {
        let signs = [us.saturating_sub(1_500), us, us + 1_500].map(|at| self.state(at).velocity.signum());
        signs[0] != signs[1] || signs[1] != signs[2]
    }
}

fn check(ideal: &Ideal, world: &World, axis: &AxisSettings) {
    let length = 1e6 / f64::from(axis.steps_per_unit);
    let mut step = (ideal.rest as f64 / FINE / length + 0.5).floor();
    let mut fastest = 0.0_f64;
    for (index, &(ns, forward)) in world.rig.axes[0].log.iter().enumerate() {
        let (sign, middle) = if forward { (1.0, step + 0.5) } else { (-1.0, step - 0.5) };
        step += sign;
        let [before, after] = [ns - 1_000, ns + 1_000].map(|ns| sign * (ideal.between(ns) / length - middle));
        let on_time = before <= ROUNDING && after >= -ROUNDING;
        assert!(on_time || ideal.turns_round(ns / 1_000), "step {index} at {ns} ns: {before} to {after}");
        let gap = index.checked_sub(1).map_or(f64::INFINITY, |last| (ns - world.rig.axes[0].log[last].0) as f64);
        fastest = fastest.max(1e9 / gap);
    }
    assert!(fastest <= 1.001 * f64::from(LARGEST_STEP_RATE), "{fastest} steps a second");
    let end = ideal.position(u64::MAX / 2) / length;
    assert!((step - end).abs() <= 0.5 + 1e-9, "{step} steps of {end}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200, rng_seed: RngSeed::Fixed(0x5eed), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn every_step_is_within_a_microsecond_of_the_ideal(
        first in 60_000..=220_000i32, speed in 50u16..=1000, second in 60_000..=220_000i32, wait in 5_000u64..900_000,
        other in 50u16..=1000, stop_after in 5_000u64..900_000,
    ) {
        let axis = linear();
        let mut world = World::homed([axis, rotary()]);
        world.rig.axes[0].log.clear();
        let full = Limits {
            speed: axis.speed as f32, acceleration: axis.acceleration as f32, jerk: axis.jerk as f32,
        };
        let fine = |target: i32| Fine::from(target) << FINE_BITS;
        let mut ideal = Ideal { pieces: Vec::new(), rest: world.controller.command(0).unwrap() };
        prop_assert_eq!(world.move_by(HOST, [first, 0], speed), Status::Accepted);
        ideal.go_to(&world, |from| Trajectory::reach(from, fine(first), full.scaled(f32::from(speed) / 1000.0), 0.0));
        world.wait(wait);
        prop_assert_eq!(world.move_by(HOST, [second, 0], other), Status::Accepted);
        let share = f32::from(other) / 1000.0;
        ideal.go_to(&world, |from| {
            let limits = Limits { speed: full.speed * share, ..full };
            Trajectory::reach(from, fine(second), if from.is_rest() { full.scaled(share) } else { limits }, 0.0)
        });
        world.wait(stop_after);
        let moves = world.controller.state() == ControllerState::Moving;
        prop_assert_eq!(world.ask(HOST, &Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
        if moves {
            ideal.stop(&world, full);
        }
        world.wait_for(ControllerState::Ready);
        check(&ideal, &world, &axis);
    }
}

#[test]
fn a_hundred_thousand_steps_a_second_are_made() {
    let mut world = World::homed([linear(), rotary()]);
    world.rig.axes[0].log.clear();
    assert_eq!(world.move_to([220_000, 0]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    let log = &world.rig.axes[0].log;
    assert_eq!(log.len(), 80_000);
    let quickest = log.windows(101).map(|pair| pair[100].0 - pair[0].0).min().unwrap();
    assert!(quickest.abs_diff(1_000_000) < 1_000, "100 steps in {quickest} ns");
}
