//! Plans made beside the control tick: they begin at their tick, a stop drops them, and a late one is asked for again.

mod support;

use support::{HOST, TICK_US, World, linear, rotary};
use vergence_control::{MovePlanner, RigIo, plan_ticks};
use vergence_protocol::{ControllerState, MovePhase, Request, Status, StopKind};

/// Ticks in which a plan of both axes is made.
const PLAN_TICKS: u32 = plan_ticks(2);

/// Settings and start as in `World`, but plans are made by the test.
fn homed() -> World {
    let mut world = World::homed([linear(), rotary()]);
    world.plans_itself = false;
    world
}

fn steps(world: &World) -> i32 {
    world.rig.steps(0)
}

#[test]
fn nothing_moves_before_the_tick_of_the_plan_and_everything_at_it() {
    let mut world = homed();
    let before = steps(&world);
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    let planned = MovePlanner::planned(world.controller.take_plan_request().unwrap());
    assert_eq!(world.controller.take_plan_request(), None);
    for _ in 0..PLAN_TICKS {
        assert!(!world.controller.give_plan(&planned), "too early");
        world.wait(TICK_US);
    }
    assert_eq!((steps(&world), world.controller.state()), (before, ControllerState::Moving));
    assert!(world.controller.give_plan(&planned));
    world.wait(50 * TICK_US);
    assert_ne!(steps(&world), before);
    // Once is enough.
    assert!(world.controller.give_plan(&planned));
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn a_stop_drops_the_plan() {
    let mut world = homed();
    let before = steps(&world);
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    let planned = MovePlanner::planned(world.controller.take_plan_request().unwrap());
    world.wait(3 * TICK_US);
    assert_eq!(world.ask(HOST, &Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    assert!(world.controller.give_plan(&planned), "it is done with");
    world.wait(20 * TICK_US);
    assert_eq!((steps(&world), world.controller.state()), (before, ControllerState::Ready));
    assert_eq!(world.pose().phase, MovePhase::Stopped);
}

#[test]
fn a_plan_that_is_late_is_asked_for_again_with_more_time() {
    let mut world = homed();
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    let late = world.controller.take_plan_request().unwrap();
    world.wait(u64::from(PLAN_TICKS + 1) * TICK_US);
    assert!(world.controller.give_plan(&MovePlanner::planned(late)), "nobody waits for it");
    let again = MovePlanner::planned(world.controller.take_plan_request().unwrap());
    let waited = (0..100).take_while(|_| {
        world.wait(TICK_US);
        !world.controller.give_plan(&again)
    });
    assert_eq!(waited.count() as u32, 2 * PLAN_TICKS - 1);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn a_host_that_changes_its_mind_faster_than_plans_are_made_is_followed() {
    let mut world = World::homed([linear(), rotary()]);
    for part in 0..60 {
        assert_eq!(world.move_to([100_000 + 100 * part, 1_000_000]), Status::Accepted);
        world.wait(5 * TICK_US);
    }
    let load = world.rig.axes[0].load;
    assert!(load > 70_000.0, "it moves meanwhile: {load}");
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
    assert!((world.rig.axes[0].load - 105_900.0).abs() < 30.0);
}

#[test]
fn the_plan_of_another_move_is_dropped() {
    let mut world = homed();
    let before = steps(&world);
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    let mut wrong = world.controller.take_plan_request().unwrap();
    // Planned from a place where the axis is not.
    wrong.ways[0].start.motion.position += 1;
    let wrong = MovePlanner::planned(wrong);
    world.wait(u64::from(PLAN_TICKS) * TICK_US);
    assert!(world.controller.give_plan(&wrong));
    world.wait(5 * TICK_US);
    assert_eq!(steps(&world), before);
}
