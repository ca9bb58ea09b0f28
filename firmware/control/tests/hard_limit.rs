//! The hard limit: two readings in a row reach it, and a short slow jog leads off it.

mod support;

use support::{TICK_US, World, linear, rotary};
use vergence_control::AxisSettings;
use vergence_protocol::{AxisMask, ControllerState, FaultCode, Refusal, Status};

const BOTH: AxisMask = AxisMask::first(2);
const FAR: [i32; 2] = [200_000, 2_000_000];
const AT_LIMIT: Status = Status::Refused(Refusal::AtHardLimit { axis: 0 });

/// Both axes with hard limits of either contact.
fn axes(normally_open: bool) -> [AxisSettings; 2] {
    [linear(), rotary()].map(|mut axis| {
        axis.switches.limits_normally_open = normally_open;
        axis
    })
}

fn under_way(normally_open: bool) -> World {
    let mut world = World::homed(axes(normally_open));
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait(400_321);
    assert!(world.watch.moves());
    world
}

/// Driven into the upper limit at 150 mm, and cleared; armed again.
fn at_the_upper_limit() -> World {
    let mut world = World::homed([linear(), rotary()]);
    world.rig.axes[0].hard_limits[1] = 150_000.0;
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait_for(ControllerState::Fault);
    assert_eq!((world.fault().code, world.fault().axis), (FaultCode::HardLimit, Some(0)));
    assert!(!world.rig.drivers);
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.pose().referenced, AxisMask(0));
    assert_eq!(world.arm(), Status::Accepted);
    world
}

#[test]
fn one_reading_stops_nothing_and_two_cut_the_drivers() {
    for normally_open in [false, true] {
        let mut world = under_way(normally_open);
        for _ in 0..50 {
            world.rig.axes[0].hard_limit = true;
            world.wait(TICK_US);
            world.rig.axes[0].hard_limit = false;
            world.wait(TICK_US);
        }
        assert_eq!(world.controller.state(), ControllerState::Moving);
        world.rig.axes[0].hard_limit = true;
        world.wait(2 * TICK_US);
        assert!(!world.rig.drivers);
        assert_eq!((world.fault().code, world.fault().axis), (FaultCode::HardLimit, Some(0)));
    }
}

#[test]
fn only_a_short_jog_away_from_the_limit_is_allowed() {
    let mut world = at_the_upper_limit();
    world.wait(500_000);
    assert!(world.rig.drivers, "at rest at the limit is no fault: somebody knows");
    assert_eq!(world.move_to(FAR), AT_LIMIT);
    assert_eq!(world.home(BOTH), AT_LIMIT);
    // Deeper; and further than the 3 mm of `home_retract` beyond the place where it was met.
    for by in [1, 1_000, -4_000] {
        assert_eq!(world.jog([by, 0]), AT_LIMIT, "{by}");
    }
    let before = world.rig.axes[0].load;
    assert_eq!(world.jog([-2_500, 0]), Status::Accepted);
    let (mut fastest, mut last) = (0.0_f64, before);
    while world.controller.state() == ControllerState::Moving {
        world.wait(TICK_US);
        let load = world.rig.axes[0].load;
        assert!(load <= before + 1.0, "never deeper");
        fastest = fastest.max((last - load).abs() / 1e-3);
        last = load;
    }
    assert!(fastest <= 1.01 * f64::from(linear().homing.seek_speed), "{fastest}");
    assert!((before - last - 2_500.0).abs() < 20.0);
    world.wait(10_000);
    assert_eq!(world.home(BOTH), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().referenced, BOTH);
    assert_eq!(world.move_to(FAR), Status::Accepted);
    world.wait_for(ControllerState::Fault);
    assert_eq!(world.fault().code, FaultCode::HardLimit, "off it, the limit counts again");
}

#[test]
fn a_wire_that_breaks_in_mid_range_never_lets_an_axis_run_away() {
    let mut world = under_way(false);
    world.rig.axes[0].hard_limit = true;
    world.wait_for(ControllerState::Fault);
    let met = world.rig.axes[0].load;
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.arm(), Status::Accepted);
    while world.jog([-1_000, 0]) == Status::Accepted {
        world.wait_for(ControllerState::Ready);
    }
    assert!(met - world.rig.axes[0].load <= 3_200.0, "{} from {met}", world.rig.axes[0].load);
}

/// After a start the board does not know which way is out.
#[test]
fn where_the_way_out_is_unknown_half_as_far_may_be_tried_in_either_direction() {
    let mut world = World::new([230_000.0, 0.0]);
    world.rig.axes[0].hard_limits[1] = 229_000.0;
    world.wait(10_000);
    assert_eq!(world.arm(), Status::Accepted);
    world.wait_for(ControllerState::Fault);
    assert_eq!(world.fault().code, FaultCode::HardLimit, "nobody knew");
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.arm(), Status::Accepted);
    for by in [1_600, -1_600] {
        assert_eq!(world.jog([by, 0]), AT_LIMIT, "{by}");
    }
    assert_eq!(world.jog([-1_400, 0]), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    world.wait(10_000);
    assert_eq!(world.home(BOTH), Status::Accepted, "released");
}

#[test]
fn a_limit_behind_another_fault_is_a_fault_of_its_own() {
    let mut world = under_way(false);
    world.rig.emergency_stop = true;
    world.wait_for(ControllerState::Fault);
    world.rig.axes[1].hard_limit = true;
    world.rig.emergency_stop = false;
    world.wait(10_000);
    assert_eq!(world.clear(), Status::Accepted);
    assert_eq!(world.arm(), Status::Accepted);
    world.wait_for(ControllerState::Fault);
    assert_eq!((world.fault().code, world.fault().axis), (FaultCode::HardLimit, Some(1)));
}
