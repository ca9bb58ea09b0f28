//! The safety promises, one story each.

mod support;

use support::{HOST, LEASE_MS, OTHER, TICK_US, World, linear, rotary};
use vergence_protocol::{
    AxisMask, ControllerState, Counts, DriverState, FaultCode, Mode, MovePhase, Refusal, Request, SessionId, Status,
    StopKind,
};

const BOTH: AxisMask = AxisMask::first(2);
const FAR: [i32; 2] = [200_000, 2_000_000];

fn homed() -> World {
    World::homed([linear(), rotary()])
}

/// In the middle of a move to [`FAR`].
fn under_way() -> World {
    let mut world = homed();
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait(400_321);
    assert!(world.watch.moves());
    world
}

fn settled_at(targets: [i32; 2]) -> World {
    let mut world = homed();
    assert_eq!(world.move_to(targets), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
    world
}

fn stop(world: &mut World, kind: StopKind) -> Status {
    world.ask(HOST, &Request::Stop { kind })
}

fn refused(why: Refusal) -> Status {
    Status::Refused(why)
}

#[test]
fn arming_needs_a_heartbeat_of_the_same_session() {
    let mut world = World::new([100_000.0, 0.0]);
    assert_eq!(world.ask(OTHER, &Request::Arm { session: OTHER }), refused(Refusal::NoLease));
    assert_eq!(world.ask(HOST, &Request::Arm { session: OTHER }), refused(Refusal::WrongSession));
    world.alive = false;
    world.wait(u64::from(LEASE_MS) * 1000);
    assert_eq!(world.arm(), refused(Refusal::NoLease));
    assert!(!world.rig.drivers);
}

#[test]
fn nothing_moves_before_arming_and_homing() {
    let mut world = World::new([100_000.0, 0.0]);
    assert_eq!(world.move_to(FAR), refused(Refusal::NotArmed));
    assert_eq!(world.home(BOTH), refused(Refusal::NotArmed));
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.arm(), Status::Accepted, "arming twice is arming");
    assert_eq!(world.move_to(FAR), refused(Refusal::NotReferenced { axis: 0 }));
    world.wait(50_000);
    assert!(!world.watch.moves());
}

#[test]
fn another_session_can_neither_move_nor_keep_the_board_alive() {
    let mut world = settled_at([100_000, 1_000_000]);
    world.other_beats();
    assert_eq!(world.ask(OTHER, &Request::Arm { session: OTHER }), refused(Refusal::WrongSession));
    assert_eq!(world.move_by(OTHER, FAR, 1000), refused(Refusal::WrongSession));
    assert_eq!(world.ask(OTHER, &Request::Home { axes: BOTH }), refused(Refusal::WrongSession));
    world.alive = false;
    for _ in 0..15 {
        world.other_beats();
        world.wait(10_000);
    }
    assert_eq!(world.controller.state(), ControllerState::LinkLost);
    // Free again, it is the other's: its heartbeats count since the board is latched.
    world.other_beats();
    world.clear();
    assert_eq!(world.ask(OTHER, &Request::Arm { session: OTHER }), Status::Accepted);
}

#[test]
fn nothing_starts_between_the_end_of_the_lease_and_the_tick_that_notices() {
    let mut world = settled_at([100_000, 1_000_000]);
    world.alive = false;
    let after = world.watch.lease_ends() + 100;
    assert_ne!(after % TICK_US, 0, "on a tick it would be noticed");
    world.wait(after - world.now.0);
    assert_eq!(world.controller.state(), ControllerState::Ready);
    assert_eq!(world.move_to(FAR), refused(Refusal::NoLease));
    assert_eq!(world.home(BOTH), refused(Refusal::NoLease));
    assert_eq!(world.arm(), refused(Refusal::NoLease), "not even arming what is armed");
}

#[test]
fn another_session_cannot_end_the_lease_of_the_holder() {
    let mut world = under_way();
    for _ in 0..30 {
        world.other_beats();
        world.wait(7_000);
        assert_eq!(world.controller.state(), ControllerState::Moving);
    }
}

#[test]
fn a_lease_is_never_longer_than_a_second() {
    let mut world = homed();
    world.alive = false;
    world.controller.heartbeat(world.now, HOST, u16::MAX);
    world.watch.heartbeat(world.now, HOST, 1000);
    world.wait(999_000);
    assert_eq!(world.controller.state(), ControllerState::Ready);
    world.wait(2 * TICK_US);
    assert_eq!(world.controller.state(), ControllerState::LinkLost);
}

#[test]
fn a_stop_in_motion_brakes_keeps_the_reference_and_allows_another_move() {
    let mut world = under_way();
    assert_eq!(stop(&mut world, StopKind::Decelerate), Status::Accepted);
    assert_eq!(world.controller.state(), ControllerState::Stopping);
    assert_eq!(world.move_to(FAR), refused(Refusal::Busy));
    world.wait_for(ControllerState::Ready);
    let pose = world.pose();
    assert_eq!((pose.phase, pose.referenced, pose.mode), (MovePhase::Stopped, BOTH, Mode(0)));
    assert!(world.rig.axes[0].load < 199_000.0 && world.rig.axes[0].load > 61_000.0);
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn any_session_may_stop() {
    let mut world = under_way();
    let request = Request::Stop { kind: StopKind::Decelerate };
    assert_eq!(world.ask(SessionId(0), &request), Status::Accepted);
    world.wait_for(ControllerState::Ready);
}

#[test]
fn torque_off_in_motion_loses_the_reference_at_rest_it_does_not() {
    let mut world = under_way();
    assert_eq!(stop(&mut world, StopKind::TorqueOff), Status::Accepted);
    let pose = world.pose();
    assert!(!world.rig.drivers);
    assert_eq!((pose.state, pose.referenced, pose.phase), (ControllerState::Idle, AxisMask(0), MovePhase::Stopped));

    let mut world = settled_at([100_000, 1_000_000]);
    stop(&mut world, StopKind::TorqueOff);
    let pose = world.pose();
    assert!(!world.rig.drivers);
    assert_eq!((pose.state, pose.referenced, pose.mode), (ControllerState::Idle, BOTH, Mode(2)));
}

#[test]
fn torque_off_while_braking_for_a_lost_link_stays_latched() {
    let mut world = under_way();
    world.alive = false;
    world.wait_for(ControllerState::LinkLost);
    assert!(world.watch.moves());
    stop(&mut world, StopKind::TorqueOff);
    let pose = world.pose();
    assert!(!world.rig.drivers);
    assert_eq!((pose.state, pose.referenced), (ControllerState::LinkLost, AxisMask(0)));
    assert_eq!(world.clear(), Status::Accepted);
}

#[test]
fn disarming_keeps_the_reference_and_in_motion_brakes_first() {
    let mut world = settled_at([100_000, 1_000_000]);
    assert_eq!(world.ask(HOST, &Request::Disarm), Status::Accepted);
    assert_eq!((world.controller.state(), world.rig.drivers), (ControllerState::Idle, false));
    assert_eq!(world.pose().referenced, BOTH);

    let mut world = under_way();
    assert_eq!(world.ask(HOST, &Request::Disarm), Status::Accepted);
    assert!(world.rig.drivers, "a moving stage is not let go");
    world.wait_for(ControllerState::Idle);
    assert!(!world.rig.drivers);
    assert_eq!(world.pose().referenced, BOTH);
    world.arm();
    assert_eq!(world.move_to(FAR), Status::Accepted);
}

#[test]
fn a_stage_moved_by_hand_is_followed_by_the_encoder() {
    let mut world = settled_at([100_000, 1_000_000]);
    let mode = world.pose().mode;
    assert_ne!(mode, Mode(0));
    world.ask(HOST, &Request::Disarm);
    assert_eq!(world.pose().mode, mode, "still there");
    let before = world.pose().counts[0].0;
    world.rig.push(0, 7_000.0);
    world.wait(30_000);
    assert_eq!(world.pose().counts[0], Counts(before + 14_000));
    assert_eq!(world.pose().mode, Mode(0), "no longer there");
    // The watch would see a jump: the next move starts where the stage is.
    assert_eq!(world.arm(), Status::Accepted);
    world.wait(20_000);
    assert!((world.rig.axes[0].load - 107_000.0).abs() < 10.0, "arming moved the stage");
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert!((world.rig.axes[0].load - 100_000.0).abs() < 10.0);
}

#[test]
fn a_move_is_settled_by_the_encoder_not_by_the_command() {
    let mut world = homed();
    world.move_to([100_000, 1_000_000]);
    world.wait(100_000);
    world.rig.axes[0].misread = 100.0;
    while world.pose().phase != MovePhase::Settling {
        world.wait(TICK_US);
    }
    world.wait(300_000);
    assert_eq!(world.pose().phase, MovePhase::Settling);
    world.rig.axes[0].misread = 0.0;
    world.wait(48_000);
    assert_eq!(world.pose().phase, MovePhase::Settling, "the dwell is not over");
    world.wait(5_000);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn a_move_that_does_not_settle_is_a_fault_after_which_that_axis_does_not_know_where_it_is() {
    let mut world = homed();
    world.move_to([100_000, 1_000_000]);
    world.rig.axes[0].misread = 100.0;
    world.wait_for(ControllerState::Fault);
    let pose = world.pose();
    let fault = pose.fault.unwrap();
    assert_eq!((fault.code, fault.axis, pose.phase), (FaultCode::NotSettled, Some(0), MovePhase::Stopped));
    assert!((-101..=-99).contains(&fault.detail), "{}", fault.detail);
    assert_eq!((pose.referenced, pose.mode), (AxisMask::default().with(1), Mode(0)));
    assert!(world.rig.drivers, "the stage is held");
}

#[test]
fn a_blocked_stage_cuts_the_drivers_and_loses_the_reference() {
    let mut world = under_way();
    world.rig.axes[1].blocked = true;
    world.wait_for(ControllerState::Fault);
    let pose = world.pose();
    let fault = pose.fault.unwrap();
    assert_eq!((fault.code, fault.axis), (FaultCode::Stall, Some(1)));
    // Above half the limit of one degree by less than the way of two ticks.
    assert!((8_727..=8_727 + 5_000).contains(&fault.detail), "{}", fault.detail);
    assert!(!world.rig.drivers);
    assert_eq!((pose.referenced, pose.phase), (AxisMask(0), MovePhase::Stopped));
}

#[test]
fn the_emergency_stop_is_observed_latched_and_cleared_only_when_released() {
    let mut world = under_way();
    world.rig.emergency_stop = true;
    world.wait(TICK_US);
    assert_eq!(world.pose().fault_code(), Some(FaultCode::EmergencyStop));
    assert!(!world.rig.drivers);
    assert_eq!(world.clear(), refused(Refusal::CausePersists));
    world.rig.emergency_stop = false;
    world.wait(100_000);
    assert_eq!(world.controller.state(), ControllerState::Fault, "release clears nothing");
    assert_eq!(world.arm(), refused(Refusal::Latched));
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.pose().referenced, AxisMask(0));
    world.rig.emergency_stop = true;
    assert_eq!(world.arm(), refused(Refusal::CausePersists));
}

/// All that a motor driver can report. Each leaves the motors without power and the positions unknown.
const DRIVER_FAULTS: [FaultCode; 6] = [
    FaultCode::DriverSilent,
    FaultCode::DriverGarbled,
    FaultCode::DriverUnset,
    FaultCode::DriverReset,
    FaultCode::DriverOverheated,
    FaultCode::DriverShort,
];

#[test]
fn a_motor_driver_that_fails_cuts_all_motors_within_a_tick() {
    for code in DRIVER_FAULTS {
        let mut world = under_way();
        world.rig.axes[1].driver = DriverState::Hot;
        world.wait(10 * TICK_US);
        assert_eq!(world.controller.state(), ControllerState::Moving, "a warning stops nothing");
        world.rig.axes[1].driver = DriverState::Failed(code);
        world.wait(TICK_US);
        assert_eq!((world.fault().code, world.fault().axis), (code, Some(1)));
        assert_eq!((world.rig.drivers, world.pose().referenced), (false, AxisMask(0)));
        // Clearing is no use while it lasts, and arming says why.
        assert_eq!(world.clear(), Status::Accepted);
        assert_eq!(world.arm(), refused(Refusal::DriverNotReady { axis: 1, why: Some(code) }));
        world.rig.axes[1].driver = DriverState::Starting;
        assert_eq!(world.arm(), refused(Refusal::DriverNotReady { axis: 1, why: None }));
        assert!(!world.rig.drivers);
        world.rig.axes[1].driver = DriverState::Ready;
        assert_eq!(world.arm(), Status::Accepted);
    }
}

#[test]
fn a_motor_driver_that_fails_while_disarmed_is_no_fault() {
    let mut world = World::new([100_000.0, 0.0]);
    world.wait(100_000);
    world.rig.axes[0].driver = DriverState::Failed(FaultCode::DriverSilent);
    world.wait(100_000);
    assert_eq!((world.controller.state(), world.pose().fault), (ControllerState::Idle, None));
}

#[test]
fn the_first_fault_is_kept_and_later_ones_are_counted() {
    let mut world = under_way();
    world.alive = false;
    world.wait_for(ControllerState::LinkLost);
    let first = world.pose().fault.unwrap();
    assert_eq!((first.code, first.later), (FaultCode::LeaseExpired, 0));
    world.rig.emergency_stop = true;
    world.wait(50_000);
    let kept = world.pose().fault.unwrap();
    assert_eq!((kept.code, kept.seq, kept.at, kept.later), (first.code, first.seq, first.at, 1));
    assert_eq!(world.controller.state(), ControllerState::Fault);
    assert!(!world.rig.drivers);
}

#[test]
fn clearing_needs_the_fault_that_was_seen_and_rest_and_never_moves() {
    let mut world = under_way();
    assert_eq!(world.ask(HOST, &Request::ClearFault { seen: 0 }), refused(Refusal::WrongFault));
    world.alive = false;
    world.wait_for(ControllerState::LinkLost);
    let seen = world.pose().fault.unwrap().seq;
    for wrong in [0, seen.wrapping_sub(1), seen.wrapping_add(1), u16::MAX] {
        if wrong != seen {
            assert_eq!(world.ask(HOST, &Request::ClearFault { seen: wrong }), refused(Refusal::WrongFault));
        }
    }
    assert_eq!(world.clear(), refused(Refusal::Busy));
    world.wait(400_000);
    world.alive = true;
    world.wait(50_000);
    assert_eq!(world.arm(), refused(Refusal::Latched));
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!((world.controller.state(), world.rig.drivers), (ControllerState::Idle, false));
    assert_eq!(world.ask(HOST, &Request::ClearFault { seen }), refused(Refusal::WrongFault), "cleared is cleared");
    world.wait(200_000);
    assert!(!world.watch.moves());
    assert_eq!(world.move_to(FAR), refused(Refusal::NotArmed));
    // The reference survived, and the next fault has another number.
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.rig.emergency_stop = true;
    world.wait(TICK_US);
    assert_ne!(world.pose().fault.unwrap().seq, seen);
}
