//! Moves and settings, one story each.

mod support;

use support::{HOST, World, linear, rotary};
use vergence_control::{AxisSettings, Controller, Event, SettingsError};
use vergence_protocol::{
    AxisList, AxisMask, ControllerState, Micro, Microseconds, Mode, Move, MoveId, MovePhase, Permille, Refusal,
    Request, Status,
};

const BOTH: AxisMask = AxisMask::first(2);
const FAR: [i32; 2] = [200_000, 2_000_000];

fn homed() -> World {
    World::homed([linear(), rotary()])
}

fn refused(why: Refusal) -> Status {
    Status::Refused(why)
}

#[test]
fn a_senseless_move_is_refused() {
    let mut world = homed();
    assert_eq!(world.move_by(HOST, FAR, 0), refused(Refusal::Invalid));
    assert_eq!(world.move_by(HOST, FAR, 1001), refused(Refusal::Invalid));
    let targets: AxisList<Micro> = [Micro(100_000)].into_iter().collect();
    let short = Move { id: MoveId(9), mode: Mode(1), targets, speed: Permille::FULL };
    assert_eq!(world.ask(HOST, &Request::MoveTo(short)), refused(Refusal::Invalid));
    assert_eq!(world.ask(HOST, &Request::GetInfo), refused(Refusal::Invalid));
    assert_eq!(world.controller.state(), ControllerState::Ready);
}

#[test]
fn one_motion_at_a_time() {
    let mut world = homed();
    assert_eq!(world.move_to(FAR), Status::Accepted);
    assert_eq!(world.move_to([100_000, 0]), refused(Refusal::Busy));
    assert_eq!(world.home(BOTH), refused(Refusal::Busy));
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.move_to([100_000, 0]), Status::Accepted);
}

#[test]
fn a_move_tells_its_phases_in_order() {
    let mut world = homed();
    while world.controller.take_event().is_some() {}
    world.move_to([100_000, 1_000_000]);
    world.wait_for(ControllerState::Ready);
    let mut phases = Vec::new();
    while let Some(event) = world.controller.take_event() {
        match event {
            Event::MoveState { id, phase } => phases.push((id, phase)),
            Event::Fault(fault) => panic!("{fault:?}"),
        }
    }
    let id = world.pose().move_id;
    assert_eq!(phases, [MovePhase::Running, MovePhase::Settling, MovePhase::Settled].map(|phase| (id, phase)));
}

#[test]
fn a_move_to_here_settles_after_the_dwell() {
    let mut world = homed();
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    world.wait(55_000);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn slow_moves_keep_the_path_and_arrive() {
    let mut world = homed();
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.move_by(HOST, [100_500, 1_010_000], 50), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn settings_that_no_axis_can_work_with_are_named() {
    let error = |axes: &[AxisSettings]| Controller::new(axes).err();
    assert_eq!(error(&[]), Some(SettingsError::AxisCount));
    assert_eq!(error(&[linear(); 9]), Some(SettingsError::AxisCount));
    assert_eq!(error(&[linear(), AxisSettings { jerk: 0, ..rotary() }]), Some(SettingsError::NotPositive { axis: 1 }));
    assert_eq!(
        error(&[AxisSettings { tolerance: Micro(0), ..linear() }]),
        Some(SettingsError::NotPositive { axis: 0 })
    );
    assert_eq!(error(&[AxisSettings { max: Micro(60_000), ..linear() }]), Some(SettingsError::Range { axis: 0 }));
    let mut switch_inside = linear();
    switch_inside.homing.switch_at = switch_inside.min;
    assert_eq!(error(&[switch_inside]), Some(SettingsError::Range { axis: 0 }));
    assert!(Controller::new(&[linear(); 8]).is_ok_and(|controller| controller.axis_count() == 8));
}

#[test]
fn a_pose_of_a_fresh_board_claims_nothing() {
    let world = World::new([100_000.0, 1_000_000.0]);
    let pose = world.pose();
    assert_eq!((pose.state, pose.referenced, pose.mode), (ControllerState::Idle, AxisMask(0), Mode(0)));
    assert_eq!((pose.phase, pose.fault, pose.at), (MovePhase::None, None, world.now));
    assert_ne!(pose.at, Microseconds(0));
}
