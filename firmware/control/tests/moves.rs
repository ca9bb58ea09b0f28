//! Moves and settings, one story each.

mod support;

use support::{HOST, OTHER, TICK_US, World, commanded, linear, rotary};
use vergence_control::{AxisSettings, Controller, Event, SettingsError};
use vergence_protocol::{
    AxisList, AxisMask, ControllerState, Jog, Micro, Microseconds, Mode, Move, MoveId, MovePhase, Permille, Refusal,
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
fn no_homing_and_no_jog_in_mid_move() {
    let mut world = homed();
    assert_eq!(world.move_to(FAR), Status::Accepted);
    assert_eq!(world.home(BOTH), refused(Refusal::Busy));
    assert_eq!(world.jog([100, 100]), refused(Refusal::Busy));
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.move_to([100_000, 0]), Status::Accepted);
}

#[test]
fn another_target_in_mid_move_ends_the_old_move_and_is_reached() {
    for wait in [1_000, 40_000, 150_000, 400_000, 700_000, 830_000] {
        let mut world = homed();
        assert_eq!(world.move_to(FAR), Status::Accepted);
        world.wait(wait);
        while world.controller.take_event().is_some() {}
        assert_eq!(world.move_to([100_000, 300_000]), Status::Accepted);
        let old = MoveId(world.pose().move_id.0 - 1);
        let stopped = Event::MoveState { id: old, phase: MovePhase::Stopped };
        assert_eq!(world.controller.take_event(), Some(stopped));
        assert_eq!(world.controller.state(), ControllerState::Moving);
        // Both come to rest in the same tick.
        let mut rests = [0; 2];
        let mut before = [0.0; 2];
        while world.controller.state() == ControllerState::Moving {
            world.wait(TICK_US);
            for axis in 0..2 {
                let command = commanded(&world.controller, axis);
                if (command - before[axis]).abs() > 1e-9 {
                    rests[axis] = world.now.0;
                }
                before[axis] = command;
            }
        }
        assert!((before[0] - 100_000.0).abs() < 1e-9 && (before[1] - 300_000.0).abs() < 1e-9, "{before:?}");
        assert!(rests[0].abs_diff(rests[1]) <= 2 * TICK_US, "{rests:?} after {wait}");
        assert_eq!((world.pose().phase, world.pose().mode), (MovePhase::Settled, Mode(3)));
    }
}

#[test]
fn only_the_holder_with_a_live_lease_changes_the_target() {
    let mut world = homed();
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait(300_000);
    assert_eq!(world.move_by(OTHER, [100_000, 0], 1000), refused(Refusal::WrongSession));
    assert_eq!(world.move_to([10_000, 0]), refused(Refusal::OutsideLimits { axis: 0 }));
    assert_eq!(world.move_by(HOST, [100_000, 0], 0), refused(Refusal::Invalid));
    world.wait_for(ControllerState::Ready);
    assert!((world.rig.axes[0].load - 200_000.0).abs() < 10.0, "what was refused changed nothing");
}

/// 140 mm at 200 mm/s and 1.5 m/s²: d/v + v/a + a/j.
#[test]
fn the_slowest_axis_takes_no_more_than_two_percent_longer_than_it_must() {
    let mut world = homed();
    let start = world.now.0;
    assert_eq!(world.move_to([200_000, 1_000_000]), Status::Accepted);
    while world.pose().phase == MovePhase::Running {
        world.wait(TICK_US);
    }
    let least = 140.0 / 200.0 + 200.0 / 1500.0 + 1.5 / 40.0;
    let took = (world.now.0 - start) as f64 * 1e-6;
    assert!((least..least * 1.02).contains(&took), "{took} of {least} s");
}

#[test]
fn a_jog_without_reference_goes_at_homing_speed_and_no_further_than_the_search() {
    let mut world = World::new([100_000.0, 500_000.0]);
    assert_eq!(world.jog([5_000, 0]), refused(Refusal::NotArmed));
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.jog([200_001, 0]), refused(Refusal::OutsideLimits { axis: 0 }));
    assert_eq!(world.jog([0, -2_792_528]), refused(Refusal::OutsideLimits { axis: 1 }));
    assert_eq!(world.jog([30_000, -50_000]), Status::Accepted);
    let (mut fastest, mut last) = (0.0_f64, world.rig.axes[0].load);
    while world.controller.state() == ControllerState::Moving {
        world.wait(TICK_US);
        fastest = fastest.max((world.rig.axes[0].load - last).abs() * 1000.0);
        last = world.rig.axes[0].load;
    }
    assert!((99_000.0..=103_000.0).contains(&fastest), "{fastest}");
    let pose = world.pose();
    assert_eq!((pose.phase, pose.mode, pose.referenced), (MovePhase::Settled, Mode(0), AxisMask(0)));
    assert!((world.rig.axes[0].load - 130_000.0).abs() < 3.0 && (world.rig.axes[1].load - 450_000.0).abs() < 60.0);
}

#[test]
fn a_jog_with_reference_keeps_to_the_range() {
    let mut world = homed();
    assert_eq!(world.jog([-1, 0]), refused(Refusal::OutsideLimits { axis: 0 }));
    assert_eq!(world.jog([160_001, 0]), refused(Refusal::OutsideLimits { axis: 0 }));
    assert_eq!(world.jog([40_000, 500_000]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.jog([-10_000, 0]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert!((world.rig.axes[0].load - 90_000.0).abs() < 10.0, "{}", world.rig.axes[0].load);
    let short = Request::Jog(Jog { id: MoveId(1), by: [Micro(1)].into_iter().collect(), speed: Permille::FULL });
    assert_eq!(world.ask(HOST, &short), refused(Refusal::Invalid));
}

/// The same place from below and from above: with one-sided approach the motor always comes from the same side.
#[test]
fn with_play_every_move_ends_upwards() {
    let settings = [AxisSettings { backlash: Micro(500), ..linear() }, rotary()];
    let mut world = World::homed(settings);
    for (start, wait) in [(80_000, None), (200_000, None), (120_300, None), (60_000, None), (200_000, Some(450_000))] {
        assert_eq!(world.move_to([start, 0]), Status::Accepted);
        match wait {
            Some(us) => world.wait(us),
            None => world.wait_for(ControllerState::Ready),
        }
        assert_eq!(world.move_to([120_000, 1_000_000]), Status::Accepted);
        let (mut way_up, mut last) = (0.0, commanded(&world.controller, 0));
        while world.controller.state() == ControllerState::Moving {
            world.wait(TICK_US);
            let command = commanded(&world.controller, 0);
            way_up = if command < last - 1e-9 { 0.0 } else { way_up + command - last };
            last = command;
        }
        assert!(way_up >= 499.9, "only {way_up} from {start}");
        assert!((last - 120_000.0).abs() < 1e-9);
        assert_eq!(world.pose().phase, MovePhase::Settled);
    }
    // Already there from below: nothing moves.
    assert_eq!(world.move_to([120_000, 1_000_000]), Status::Accepted);
    world.wait(10_000);
    assert!(!world.watch.moves());
    world.wait_for(ControllerState::Ready);
    // At the low end the run-up lies below the range, but above the switch.
    assert_eq!(world.move_to([60_000, 0]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().phase, MovePhase::Settled);
}

#[test]
fn a_motor_or_an_encoder_wired_the_other_way_round_is_a_setting() {
    for [steps_reversed, counts_reversed] in [[true, false], [false, true], [true, true]] {
        let mut world = World::homed([AxisSettings { steps_reversed, counts_reversed, ..linear() }, rotary()]);
        assert_eq!(world.move_to([150_000, 100_000]), Status::Accepted);
        world.wait_for(ControllerState::Ready);
        assert!((world.rig.axes[0].load - 150_000.0).abs() < 10.0);
        assert_eq!(world.pose().phase, MovePhase::Settled);
    }
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
    // 50 ms of dwell, after 8 ms in which the move is planned.
    world.wait(63_000);
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
    let play = AxisSettings { backlash: Micro(2_000), ..linear() };
    assert_eq!(error(&[play]), Some(SettingsError::Range { axis: 0 }), "the run-up would touch the switch");
    let fast = AxisSettings { steps_per_unit: 500_001, ..linear() };
    assert_eq!(error(&[fast]), Some(SettingsError::StepRate { axis: 0 }));
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
