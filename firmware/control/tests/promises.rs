//! The seven promises of the board, each a test by its name. [`support::Watch`] looks on at every tick.

mod support;

use support::{HOST, LEASE_MS, OTHER, TICK_US, World, linear, longest_stop_us, rotary};
use vergence_control::AxisSettings;
use vergence_protocol::{
    AxisMask, ControllerState, FaultCode, FaultRecord, Micro, Mode, MovePhase, Refusal, Request, SessionId, Status,
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

fn refused(why: Refusal) -> Status {
    Status::Refused(why)
}

/// Nothing moves for 50 ms.
fn check_still(world: &mut World) {
    let loads = [0, 1].map(|axis| world.rig.axes[axis].load.to_bits());
    world.wait(50_000);
    assert_eq!([0, 1].map(|axis| world.rig.axes[axis].load.to_bits()), loads);
}

/// 1. No motion without: matching session, live lease, armed, homed (except homing and jogs), target inside the soft limits
///    (checked on the board, refused, not clamped).
#[test]
fn promise_1_no_motion_without_session_lease_arm_reference_and_range() {
    let mut world = World::new([100_000.0, 500_000.0]);
    // Not armed.
    assert_eq!(world.move_to(FAR), refused(Refusal::NotArmed));
    assert_eq!(world.home(BOTH), refused(Refusal::NotArmed));
    assert_eq!(world.jog([100, 0]), refused(Refusal::NotArmed));
    // No lease, and another's.
    assert_eq!(world.ask(OTHER, &Request::Arm { session: OTHER }), refused(Refusal::NoLease));
    assert_eq!(world.ask(HOST, &Request::Arm { session: OTHER }), refused(Refusal::WrongSession));
    assert_eq!(world.arm(), Status::Accepted);
    // No reference.
    assert_eq!(world.move_to(FAR), refused(Refusal::NotReferenced { axis: 0 }));
    check_still(&mut world);
    assert_eq!(world.home(BOTH), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    // Another session.
    assert_eq!(world.move_by(OTHER, FAR, 1000), refused(Refusal::WrongSession));
    assert_eq!(world.ask(SessionId(0), &Request::Home { axes: BOTH }), refused(Refusal::WrongSession));
    // Out of range, by one.
    for (targets, axis) in
        [([59_999, 0], 0), ([220_001, 0], 0), ([60_000, -1], 1), ([60_000, 2_268_929], 1), ([i32::MAX, 0], 0)]
    {
        assert_eq!(world.move_to(targets), refused(Refusal::OutsideLimits { axis }));
    }
    assert_eq!(world.jog([i32::MIN, 0]), refused(Refusal::OutsideLimits { axis: 0 }));
    check_still(&mut world);
    // Lease over, not noticed yet.
    world.alive = false;
    world.wait(world.watch.lease_ends() + 100 - world.now.0);
    assert_eq!(world.controller.state(), ControllerState::Ready);
    for status in [world.move_to(FAR), world.home(BOTH), world.jog([100, 0])] {
        assert_eq!(status, refused(Refusal::NoLease));
    }
    check_still(&mut world);
}

/// 2. Every heartbeat of the right session renews the lease. Without it everything stands after lease + v/a + 2a/j.
#[test]
fn promise_2_a_silent_host_means_rest_within_lease_and_stopping_time() {
    let bound = longest_stop_us(&linear()).max(longest_stop_us(&rotary())) + 2 * TICK_US;
    for wait in [1_000, 30_000, 100_000, 400_000, 700_000] {
        for what in 0..3 {
            let mut world = homed();
            match what {
                0 => assert_eq!(world.move_to(FAR), Status::Accepted),
                1 => assert_eq!(world.home(BOTH), Status::Accepted),
                _ => assert_eq!(world.jog([140_000, 2_000_000]), Status::Accepted),
            }
            world.wait(wait);
            world.alive = false;
            let ends = world.watch.lease_ends();
            assert!(ends <= world.now.0 + u64::from(LEASE_MS) * 1000);
            world.wait(ends + bound - world.now.0);
            assert_eq!(world.controller.state(), ControllerState::LinkLost);
            check_still(&mut world);
            assert!(world.rig.drivers, "held, not dropped");
            // Another session's heartbeats keep nothing alive, and the host's return starts nothing.
            world.other_beats();
            world.alive = true;
            check_still(&mut world);
        }
    }
}

/// 3. The emergency stop is a wire to the drivers; software observes it, latches it and does not arm against it.
///    `Stop` works for anybody, in any state, but is no emergency stop.
#[test]
fn promise_3_the_emergency_stop_is_observed_and_a_stop_needs_no_permission() {
    let mut world = under_way();
    world.rig.emergency_stop = true;
    world.wait(TICK_US);
    assert_eq!((world.fault().code, world.rig.drivers), (FaultCode::EmergencyStop, false));
    assert_eq!(world.clear(), refused(Refusal::CausePersists));
    world.rig.emergency_stop = false;
    check_still(&mut world);
    assert_eq!(world.controller.state(), ControllerState::Fault, "release clears nothing");
    assert_eq!(world.clear(), Status::Accepted);
    world.rig.emergency_stop = true;
    assert_eq!(world.arm(), refused(Refusal::CausePersists));

    for (session, kind) in [(SessionId(0), StopKind::Decelerate), (OTHER, StopKind::TorqueOff)] {
        let mut world = under_way();
        assert_eq!(world.ask(session, &Request::Stop { kind }), Status::Accepted);
        world.wait(longest_stop_us(&linear()).max(longest_stop_us(&rotary())));
        check_still(&mut world);
        assert_eq!(world.rig.drivers, kind == StopKind::Decelerate);
    }
}

/// 4. After a hard limit, torque-off in motion or a lost encoder the position is unreferenced; a soft stop keeps it.
#[test]
fn promise_4_the_reference_is_claimed_only_while_it_is_known() {
    let after = |happen: fn(&mut World)| {
        let mut world = under_way();
        happen(&mut world);
        world.wait(400_000);
        world.pose().referenced
    };
    assert_eq!(after(|world| _ = world.ask(HOST, &Request::Stop { kind: StopKind::Decelerate })), BOTH);
    assert_eq!(after(|world| _ = world.ask(HOST, &Request::Disarm)), BOTH);
    assert_eq!(after(|world| world.alive = false), BOTH);
    let nothing = AxisMask(0);
    assert_eq!(after(|world| _ = world.ask(HOST, &Request::Stop { kind: StopKind::TorqueOff })), nothing);
    assert_eq!(after(|world| world.rig.axes[0].hard_limit = true), nothing);
    assert_eq!(after(|world| world.rig.emergency_stop = true), nothing);
    assert_eq!(after(|world| world.rig.axes[1].blocked = true), nothing);
    assert_eq!(after(|world| world.rig.axes[0].misread = 50_000.0), nothing);
    // While it is sought it is not claimed.
    let mut world = homed();
    assert_eq!(world.home(BOTH), Status::Accepted);
    assert_eq!(world.pose().referenced, nothing);
    assert_eq!(world.move_to(FAR), refused(Refusal::Busy));
    // At rest nothing is lost with the torque.
    let mut world = homed();
    world.ask(HOST, &Request::Stop { kind: StopKind::TorqueOff });
    assert_eq!(world.pose().referenced, BOTH);
}

/// 5. The first fault is kept with code, time and detail, later ones are counted, and every pose repeats it.
#[test]
fn promise_5_the_first_fault_is_kept_and_repeated() {
    let mut world = under_way();
    world.rig.axes[0].blocked = true;
    world.wait_for(ControllerState::Fault);
    let first = world.fault();
    assert_eq!((first.code, first.axis, first.later), (FaultCode::Stall, Some(0), 0));
    assert!(first.at <= world.now && world.now.0 - first.at.0 < 2 * TICK_US);
    world.alive = false;
    world.rig.emergency_stop = true;
    for _ in 0..200 {
        world.wait(TICK_US);
        let kept = world.fault();
        assert_eq!(FaultRecord { later: 0, ..kept }, first);
    }
    // What nobody has seen cannot be cleared.
    for wrong in [0, first.seq.wrapping_add(1)] {
        assert_eq!(world.ask(HOST, &Request::ClearFault { seen: wrong }), refused(Refusal::WrongFault));
    }

    // A second one while the first brakes is counted.
    let mut world = under_way();
    world.alive = false;
    world.wait_for(ControllerState::LinkLost);
    let first = world.fault();
    world.rig.axes[1].hard_limit = true;
    world.wait(10_000);
    let kept = world.fault();
    assert_eq!((kept.code, kept.seq, kept.at, kept.later), (first.code, first.seq, first.at, 1));
}

/// 6. After a restart the board is idle, unreferenced and remembers nothing; a host that comes back resumes no motion.
#[test]
fn promise_6_a_restart_or_a_return_resumes_nothing() {
    let mut world = under_way();
    // The processor restarts in mid-move: its outputs fall back, the stages stand where they are.
    world.restart();
    assert_eq!(world.controller.state(), ControllerState::Boot);
    world.wait(100_000);
    let pose = world.pose();
    assert_eq!((pose.state, pose.referenced, pose.mode), (ControllerState::Idle, AxisMask(0), Mode(0)));
    assert_eq!((pose.phase, pose.fault), (MovePhase::None, None));
    assert_eq!(world.move_to(FAR), refused(Refusal::NotArmed));
    check_still(&mut world);
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.move_to(FAR), refused(Refusal::NotReferenced { axis: 0 }));

    let mut world = under_way();
    world.alive = false;
    world.wait(500_000);
    world.alive = true;
    check_still(&mut world);
    assert_eq!(world.clear(), Status::Accepted);
    check_still(&mut world);
    assert_eq!(world.arm(), Status::Accepted);
    check_still(&mut world);
}

/// 7. "Mode reached" is claimed only from the encoder inside the tolerance for a dwell, never from commanded steps.
#[test]
fn promise_7_a_mode_is_reached_by_the_encoder_alone() {
    let tight = AxisSettings { tolerance: Micro(30), ..linear() };
    let mut world = World::homed([tight, rotary()]);
    assert_eq!(world.move_to([100_000, 1_000_000]), Status::Accepted);
    world.wait(100_000);
    world.rig.axes[0].misread = 31.0 + 2.0;
    while world.pose().phase != MovePhase::Settling {
        assert_eq!(world.pose().mode, Mode(0));
        world.wait(TICK_US);
    }
    // The steps are all made; the encoder is just outside.
    for _ in 0..300 {
        world.wait(TICK_US);
        assert_eq!((world.pose().mode, world.pose().phase), (Mode(0), MovePhase::Settling));
    }
    // In and out again before the dwell is over: it begins anew.
    for misread in [0.0, 40.0, 0.0, -40.0] {
        world.rig.axes[0].misread = misread;
        world.wait(45_000);
        assert_eq!(world.pose().mode, Mode(0));
    }
    world.rig.axes[0].misread = 0.0;
    world.wait(55_000);
    assert_ne!(world.pose().mode, Mode(0));
    // And no longer where it is left, armed or not.
    world.rig.axes[0].misread = 40.0;
    world.wait(TICK_US);
    assert_eq!((world.pose().mode, world.pose().phase), (Mode(0), MovePhase::Settled));
}
