//! States in which nothing may move: start, self-test, firmware update and trial.

mod support;

use support::{HOST, HomeSwitch, TICK_US, World, linear, rotary};
use vergence_protocol::{AxisMask, ControllerState, FaultCode, Refusal, Request, Status, StopKind};

const BOTH: AxisMask = AxisMask::first(2);

/// A board that has just got its power.
fn fresh() -> World {
    let mut world = World::new([100_000.0, 500_000.0]);
    world.restart();
    world
}

/// Whatever would move is refused for this reason, and nothing else changes the state.
fn refuses_motion(world: &mut World, why: Refusal) {
    let state = world.controller.state();
    for status in [world.arm(), world.home(BOTH), world.move_to([100_000, 0]), world.jog([100, 0])] {
        assert_eq!(status, Status::Refused(why));
    }
    if why == Refusal::Latched {
        return;
    }
    for request in
        [Request::Stop { kind: StopKind::Decelerate }, Request::Stop { kind: StopKind::TorqueOff }, Request::Disarm]
    {
        assert_eq!(world.ask(HOST, &request), Status::Accepted);
        assert_eq!(world.controller.state(), state, "{request:?}");
    }
    assert!(!world.rig.drivers);
}

#[test]
fn a_board_starts_tests_itself_and_is_idle() {
    let mut world = fresh();
    assert_eq!(world.controller.state(), ControllerState::Boot);
    refuses_motion(&mut world, Refusal::Busy);
    world.wait(2 * TICK_US);
    assert_eq!(world.controller.state(), ControllerState::SelfTest);
    refuses_motion(&mut world, Refusal::Busy);
    world.wait(20 * TICK_US);
    assert_eq!(world.controller.state(), ControllerState::Idle);
}

#[test]
fn an_encoder_that_jumps_by_itself_fails_the_test_until_it_stands() {
    let mut world = fresh();
    world.wait(4 * TICK_US);
    world.rig.axes[1].misread = 100_000.0;
    world.wait(2 * TICK_US);
    assert_eq!((world.fault().code, world.fault().axis), (FaultCode::EncoderLost, Some(1)));
    refuses_motion(&mut world, Refusal::Latched);
}

#[test]
fn a_switch_that_is_never_sure_fails_the_test_and_clearing_repeats_it() {
    let mut world = fresh();
    for _ in 0..150 {
        for switch in [HomeSwitch::StuckClosed, HomeSwitch::Good] {
            world.rig.axes[0].switch = switch;
            world.wait(TICK_US);
        }
    }
    assert_eq!((world.fault().code, world.fault().axis), (FaultCode::HomeSwitchStuck, Some(0)));
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.controller.state(), ControllerState::SelfTest, "not yet idle");
    world.wait(30 * TICK_US);
    assert_eq!(world.controller.state(), ControllerState::Idle);
    assert_eq!(world.arm(), Status::Accepted);
}

#[test]
fn a_pressed_emergency_stop_is_no_failure_but_one_that_flickers_is() {
    let mut world = fresh();
    world.rig.emergency_stop = true;
    world.wait(30 * TICK_US);
    assert_eq!(world.controller.state(), ControllerState::Idle);
    assert_eq!(world.arm(), Status::Refused(Refusal::CausePersists));
    let mut world = fresh();
    for tick in 0..250 {
        world.rig.emergency_stop = tick % 2 == 0;
        world.wait(TICK_US);
    }
    assert_eq!(world.fault().code, FaultCode::EmergencyStop);
}

#[test]
fn firmware_is_taken_only_while_disarmed_and_nothing_moves_meanwhile() {
    let mut world = World::homed([linear(), rotary()]);
    assert_eq!(world.controller.begin_update(), Err(Refusal::NotIdle));
    assert_eq!(world.ask(HOST, &Request::Disarm), Status::Accepted);
    assert_eq!(world.controller.begin_update(), Ok(()));
    assert_eq!(world.controller.state(), ControllerState::Updating);
    assert_eq!(world.controller.begin_update(), Err(Refusal::Updating));
    world.wait(50_000);
    refuses_motion(&mut world, Refusal::Updating);
    assert_eq!(world.pose().referenced, BOTH, "nothing has moved");
    world.controller.end_update();
    assert_eq!((world.controller.state(), world.arm()), (ControllerState::Idle, Status::Accepted));
    world.controller.end_update();
    assert_eq!(world.controller.state(), ControllerState::Ready, "there is nothing to end");
}

#[test]
fn a_fault_that_cannot_be_cleared_does_not_keep_firmware_out() {
    let mut world = World::homed([linear(), rotary()]);
    world.rig.emergency_stop = true;
    world.wait(10 * TICK_US);
    let fault = world.fault();
    assert_eq!((fault.code, world.clear()), (FaultCode::EmergencyStop, Status::Refused(Refusal::CausePersists)));
    assert_eq!(world.controller.begin_update(), Ok(()));
    // The lease of whoever held the board ends.
    world.alive = false;
    world.wait(2_000_000);
    world.alive = true;
    assert_eq!((world.pose().state, world.pose().fault), (ControllerState::Updating, Some(fault)));
    refuses_motion(&mut world, Refusal::Updating);
    world.controller.end_update();
    assert_eq!((world.pose().state, world.pose().fault), (ControllerState::Fault, Some(fault)));
    assert_eq!(world.arm(), Status::Refused(Refusal::Latched));
    world.rig.emergency_stop = false;
    world.wait(30 * TICK_US);
    assert_eq!((world.clear(), world.arm()), (Status::Accepted, Status::Accepted));
}

/// It was refused as if it were armed, and the host gave up.
#[test]
fn a_board_in_its_self_test_takes_firmware_and_goes_on_with_the_test() {
    let mut world = fresh();
    for ticks in [0, 3] {
        world.wait(ticks * TICK_US);
        let state = world.controller.state();
        assert_eq!(world.controller.begin_update(), Ok(()), "{state}");
        world.wait(50_000);
        assert_eq!(world.controller.state(), ControllerState::Updating);
        world.controller.end_update();
        assert_eq!(world.controller.state(), state);
    }
    world.wait_for(ControllerState::Idle);
}

#[test]
fn a_lost_link_takes_firmware_once_the_drivers_are_off() {
    let mut world = World::homed([linear(), rotary()]);
    world.alive = false;
    world.wait_for(ControllerState::LinkLost);
    world.wait(2_000_000);
    assert_eq!(world.controller.begin_update(), Err(Refusal::NotIdle), "the motors are held");
    assert_eq!(world.ask(HOST, &Request::Stop { kind: StopKind::TorqueOff }), Status::Accepted);
    assert_eq!(world.controller.begin_update(), Ok(()));
    world.controller.end_update();
    assert_eq!(world.controller.state(), ControllerState::LinkLost);
}

#[test]
fn a_firmware_on_trial_does_not_move_until_it_is_confirmed() {
    let mut world = fresh();
    world.controller.set_trial();
    world.wait(50_000);
    assert_eq!(world.controller.state(), ControllerState::Trial);
    refuses_motion(&mut world, Refusal::Updating);
    assert_eq!(world.controller.begin_update(), Err(Refusal::Updating), "the old one is the way back");
    world.controller.confirm_trial();
    assert_eq!((world.controller.state(), world.arm()), (ControllerState::Idle, Status::Accepted));
}
