//! Homing: what it finds, how exactly, and how it gives up.

mod support;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use support::{HOST, HomeSwitch, TICK_US, World, linear, rotary};
use vergence_control::{AxisSettings, HomeEnd, HomeSensor};
use vergence_protocol::{AxisMask, ControllerState, FaultCode, FaultRecord, Micro, Refusal, Request, Status, StopKind};

const BOTH: AxisMask = AxisMask::first(2);
const FIRST: AxisMask = AxisMask::first(1);

/// Which end is home, and by which switch. Places are told as if it were the low end: the high one is its mirror image.
#[derive(Clone, Copy, Debug)]
struct Home(HomeEnd, HomeSensor);

const HOMES: [Home; 4] = [
    Home(HomeEnd::Low, HomeSensor::NormallyOpen),
    Home(HomeEnd::High, HomeSensor::NormallyOpen),
    Home(HomeEnd::Low, HomeSensor::NormallyClosed),
    Home(HomeEnd::High, HomeSensor::NormallyClosed),
];

impl Home {
    fn settings(self) -> [AxisSettings; 2] {
        [linear(), rotary()].map(|mut axis| {
            (axis.switches.home_end, axis.switches.home) = (self.0, self.1);
            if self.0 == HomeEnd::High {
                axis.homing.switch_at = Micro(axis.min.0 + axis.max.0 - axis.homing.switch_at.0);
            }
            axis
        })
    }

    /// The place of an axis, or of its mirror image.
    fn place(self, axis: usize, load: f64) -> f64 {
        let [settings, other] = [linear(), rotary()];
        let AxisSettings { min, max, .. } = if axis == 0 { settings } else { other };
        if self.0 == HomeEnd::High { f64::from(min.0 + max.0) - load } else { load }
    }

    fn load(self, world: &World, axis: usize) -> f64 {
        self.place(axis, world.rig.axes[axis].load)
    }

    fn world(self, loads: [f64; 2]) -> World {
        World::with(self.settings(), [0, 1].map(|axis| self.place(axis, loads[axis])))
    }
}

/// A controller that has just begun homing `axes`.
fn begun(home: Home, loads: [f64; 2], axes: AxisMask) -> World {
    let mut world = home.world(loads);
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.home(axes), Status::Accepted);
    world
}

fn fault_of(world: &mut World) -> FaultRecord {
    world.wait_for(ControllerState::Fault);
    world.wait(300_000);
    assert!(!world.watch.moves());
    let pose = world.pose();
    assert_eq!(pose.referenced.0 & 1, 0, "a reference is claimed: {pose:?}");
    world.fault()
}

/// The reference is the edge seen at a tick: late by the way of one tick at most, and one count.
fn reference_error(axis: &AxisSettings) -> f64 {
    let way = f64::from(axis.homing.approach_speed) * TICK_US as f64 * 1e-6;
    way + 2.0 * f64::from(axis.encoder().position_at(1).0.max(1))
}

/// Seek over `way`, two reversals and the slow approach; every leg takes d/v + v/a + a/j at most.
fn longest_homing_us(axis: &AxisSettings, way: f64) -> u64 {
    let [a, j, seek, slow] =
        [axis.acceleration, axis.jerk, axis.homing.seek_speed, axis.homing.approach_speed].map(f64::from);
    let retract = f64::from(axis.homing.retract.0);
    let change = |v: f64| v / a + a / j;
    let brake = seek * change(seek);
    let enter = f64::from(axis.min.0 - axis.homing.switch_at.0) + brake;
    let legs = [way + 2.0 * retract, brake, 2.0 * retract + brake, enter].map(|d| d / seek + change(seek));
    let slowly = retract / slow + 2.0 * change(slow);
    ((legs.iter().sum::<f64>() + slowly) * 1e6) as u64 + 30 * TICK_US
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 100, rng_seed: RngSeed::Fixed(0x5eed), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn homing_from_anywhere_ends_at_the_end_that_is_home(
        home in prop::sample::select(&HOMES),
        baseline in 54_000.0..220_000.0,
        separation in -60_000.0..2_268_928.0,
    ) {
        let mut world = begun(home, [baseline, separation], BOTH);
        prop_assert_eq!(world.pose().referenced, AxisMask(0));
        let start = world.now.0;
        world.wait_for(ControllerState::Ready);
        prop_assert_eq!(world.pose().referenced, BOTH);
        for (axis, settings) in [linear(), rotary()].iter().enumerate() {
            let off = home.load(&world, axis) - f64::from(settings.min.0);
            prop_assert!(off.abs() <= reference_error(settings), "axis {axis} is off by {off}");
            let counts = settings.encoder().counts_at(home.settings()[axis].home_position());
            prop_assert!((world.pose().counts[axis].0 - counts).abs() <= 1);
        }
        let ways = [baseline - 58_000.0, separation + 26_180.0].map(f64::abs);
        let bound = longest_homing_us(&linear(), ways[0]) + longest_homing_us(&rotary(), ways[1]);
        prop_assert!(world.now.0 - start <= bound, "{} of {bound} us", world.now.0 - start);
    }

    #[test]
    fn homing_again_finds_the_same_place(home in prop::sample::select(&HOMES), baseline in 60_000.0..220_000.0, offset in 0.0..1.0) {
        let mut world = begun(home, [baseline, 100_000.0 + offset * 63.0], BOTH);
        world.wait_for(ControllerState::Ready);
        let first = world.rig.axes[0].load;
        prop_assert_eq!(world.home(BOTH), Status::Accepted);
        prop_assert_eq!(world.pose().referenced, AxisMask(0), "a reference is claimed while it is sought");
        world.wait_for(ControllerState::Ready);
        prop_assert!((world.rig.axes[0].load - first).abs() <= reference_error(&linear()));
    }

    #[test]
    fn a_stop_ends_homing_without_reference(home in prop::sample::select(&HOMES), wait in 0u64..1_200_000) {
        let mut world = begun(home, [150_000.0, 1_000_000.0], BOTH);
        world.wait(wait);
        prop_assert_eq!(world.ask(HOST, &Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
        world.wait_for(ControllerState::Ready);
        prop_assert_ne!(world.pose().referenced, BOTH);
        let refused = matches!(world.move_to([100_000, 0]), Status::Refused(Refusal::NotReferenced { .. }));
        prop_assert!(refused);
        prop_assert_eq!(world.home(BOTH), Status::Accepted);
        world.wait_for(ControllerState::Ready);
        prop_assert_eq!(world.pose().referenced, BOTH);
    }
}

fn only_the_named_axes_are_homed(home: Home) {
    let mut world = begun(home, [100_000.0, 500_000.0], FIRST);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().referenced, FIRST);
    assert!((home.load(&world, 1) - 500_000.0).abs() < 1e-6);
    assert_eq!(world.move_to([100_000, 0]), Status::Refused(Refusal::NotReferenced { axis: 1 }));
}

fn masks_of_nothing_or_of_no_axis_are_refused(home: Home) {
    let mut world = home.world([100_000.0, 500_000.0]);
    world.arm();
    for mask in [0, 4, 7, 128] {
        assert_eq!(world.home(AxisMask(mask)), Status::Refused(Refusal::Invalid), "{mask}");
    }
    assert_eq!(world.controller.state(), ControllerState::Ready);
}

fn a_switch_that_never_closes_is_not_found(home: Home) {
    let mut world = home.world([219_000.0, 500_000.0]);
    world.rig.axes[0].switch = HomeSwitch::NeverCloses;
    world.arm();
    world.home(FIRST);
    let fault = fault_of(&mut world);
    assert_eq!((fault.code, fault.axis, fault.detail), (FaultCode::HomeSwitchNotFound, Some(0), 200_000));
    assert!((home.load(&world, 0) - 19_000.0).abs() < 1.0, "searched the whole travel and no more");
    assert!(world.rig.drivers, "the stage is held");
}

fn a_switch_stuck_closed_is_told_from_a_stage_on_it(home: Home) {
    let mut world = home.world([100_000.0, 500_000.0]);
    world.rig.axes[0].switch = HomeSwitch::StuckClosed;
    world.arm();
    world.home(FIRST);
    let fault = fault_of(&mut world);
    // The retract, and the way in which a search brakes: v/2 (v/a + a/j) = 5208 µm, v a/j = 3750 µm,
    // and 5 ms of debounce.
    assert_eq!((fault.code, fault.axis, fault.detail), (FaultCode::HomeSwitchStuck, Some(0), 12_458));
    assert!((home.load(&world, 0) - 112_458.0).abs() < 1.0);
}

/// Begins homing and waits until the first edge has been seen.
fn at_first_edge(home: Home) -> World {
    let mut world = begun(home, [70_000.0, 500_000.0], FIRST);
    while !world.rig.axes[0].closed() {
        world.wait(TICK_US);
    }
    world.wait(TICK_US);
    world
}

fn retracted(home: Home) -> World {
    let mut world = at_first_edge(home);
    while world.rig.axes[0].closed() {
        world.wait(TICK_US);
    }
    world
}

fn a_switch_that_sticks_after_the_first_edge_is_noticed(home: Home) {
    let mut world = at_first_edge(home);
    world.rig.axes[0].switch = HomeSwitch::StuckClosed;
    let fault = fault_of(&mut world);
    assert_eq!((fault.code, fault.detail), (FaultCode::HomeSwitchStuck, 3_000));
}

fn a_switch_that_dies_after_the_first_edge_is_noticed(home: Home) {
    let mut world = retracted(home);
    world.rig.axes[0].switch = HomeSwitch::NeverCloses;
    let fault = fault_of(&mut world);
    assert_eq!((fault.code, fault.detail), (FaultCode::HomeSwitchNotFound, 6_000));
}

fn two_edges_apart_are_no_reference(home: Home) {
    for slip in [-500.0, 500.0] {
        let mut world = retracted(home);
        world.rig.axes[0].switch_at += f64::from(-home.0.sign()) * slip;
        let fault = fault_of(&mut world);
        assert_eq!((fault.code, fault.axis), (FaultCode::HomeNotRepeatable, Some(0)));
        // The first edge was seen up to one tick late at 100 mm/s, hence lower.
        assert!(
            (slip - 6.0..=slip + 101.0).contains(&f64::from(-home.0.sign() * fault.detail)),
            "{} for {slip}",
            fault.detail
        );
    }
}

fn axes_are_homed_one_after_the_other_and_a_failure_leaves_the_first_its_reference(home: Home) {
    let mut world = begun(home, [90_000.0, 1_200_000.0], BOTH);
    while world.pose().referenced == AxisMask(0) {
        world.wait(TICK_US);
        assert!((home.load(&world, 1) - 1_200_000.0).abs() < 1e-6, "both at once");
    }
    world.rig.axes[1].switch = HomeSwitch::NeverCloses;
    world.wait_for(ControllerState::Fault);
    assert_eq!((world.fault().code, world.fault().axis), (FaultCode::HomeSwitchNotFound, Some(1)));
    assert_eq!(world.pose().referenced, FIRST);
}

/// The switch wires of two axes have changed places: the axis that moves closes the input of the one that rests.
fn the_switch_of_another_axis_is_told_from_the_own(home: Home) {
    for homed in [BOTH, FIRST] {
        let mut world = begun(home, [70_000.0, 1_000_000.0], homed);
        world.rig.crossed_switches = true;
        world.wait_for(ControllerState::Fault);
        let fault = world.fault();
        assert_eq!((fault.code, fault.axis, fault.detail), (FaultCode::HomeSwitchWrong, Some(0), 1));
        // Noticed as soon as the own switch would have been.
        world.wait(200_000);
        assert!(!world.watch.moves() && home.load(&world, 0) > 48_000.0, "{}", home.load(&world, 0));
        assert_eq!(world.pose().referenced, AxisMask(0));
    }
}

fn homing_works_again_after_a_failure(home: Home) {
    let mut world = home.world([100_000.0, 500_000.0]);
    world.rig.axes[0].switch = HomeSwitch::NeverCloses;
    world.arm();
    world.home(BOTH);
    fault_of(&mut world);
    world.rig.axes[0].switch = HomeSwitch::Good;
    assert_eq!(world.clear(), Status::Accepted);
    world.rig.push(0, f64::from(-home.0.sign()) * 200_000.0);
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.home(BOTH), Status::Accepted);
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().referenced, BOTH);
}

/// Regression: found by fault injection. Two spikes on the wire of the home switch at one place passed for its two
/// edges, and the reference was off by centimetres.
fn spikes_are_not_the_edge_of_the_switch(home: Home) {
    let mut world = begun(home, [150_000.0, 100_000.0], BOTH);
    world.wait(300_000);
    let place = home.load(&world, 0);
    for _ in 0..20_000 {
        let here = (home.load(&world, 0) - place).abs() < 100.0;
        world.rig.axes[0].switch = if here { HomeSwitch::StuckClosed } else { HomeSwitch::Good };
        world.wait(TICK_US);
        world.rig.axes[0].switch = HomeSwitch::Good;
        world.wait(3 * TICK_US);
    }
    assert_eq!(world.controller.state(), ControllerState::Ready, "{:?}", world.pose());
    assert!((home.load(&world, 0) - 60_000.0).abs() <= reference_error(&linear()));
}

/// Regression: found by fault injection. A spike when homing began sent a stage at the far end further out.
fn a_spike_at_the_start_does_not_move_a_stage_off_a_switch_that_it_is_not_on(home: Home) {
    let mut world = home.world([220_000.0, 100_000.0]);
    assert_eq!(world.arm(), Status::Accepted);
    world.rig.axes[0].switch = HomeSwitch::StuckClosed;
    assert_eq!(world.home(BOTH), Status::Accepted);
    world.wait(TICK_US);
    world.rig.axes[0].switch = HomeSwitch::Good;
    for _ in 0..500 {
        world.wait(TICK_US);
        assert!(home.load(&world, 0) <= 220_000.0 + 1e-6);
    }
    world.wait_for(ControllerState::Ready);
    assert_eq!(world.pose().referenced, BOTH);
}

fn a_chattering_contact_is_found_at_its_first_touch(home: Home) {
    let mut world = begun(home, [70_000.0, 100_000.0], BOTH);
    let mut ticks_closed = 0;
    while world.controller.state() == ControllerState::Homing {
        let beyond = home.load(&world, 0) <= 58_000.0;
        ticks_closed = if beyond { ticks_closed + 1 } else { 0 };
        let chatters = (1..8).contains(&ticks_closed) && ticks_closed % 2 == 0;
        world.rig.axes[0].switch = if chatters { HomeSwitch::NeverCloses } else { HomeSwitch::Good };
        world.wait(TICK_US);
    }
    assert_eq!(world.pose().referenced, BOTH, "{:?}", world.pose());
    assert!((home.load(&world, 0) - 60_000.0).abs() <= 2.0 * reference_error(&linear()));
}

fn a_switch_that_is_never_sure_ends_homing(home: Home) {
    let mut world = begun(home, [150_000.0, 100_000.0], FIRST);
    for _ in 0..400 {
        for switch in [HomeSwitch::StuckClosed, HomeSwitch::Good] {
            world.rig.axes[0].switch = switch;
            world.wait(TICK_US);
        }
    }
    assert_eq!(world.fault().code, FaultCode::HomeSwitchStuck);
    assert!((home.load(&world, 0) - 150_000.0).abs() < 1e-6);
}

macro_rules! at_each_home {
    ($($law:ident),* $(,)?) => {
        mod at_each_home {
            $(#[test] fn $law() { super::HOMES.into_iter().for_each(super::$law); })*
        }
    };
}

at_each_home!(
    only_the_named_axes_are_homed,
    masks_of_nothing_or_of_no_axis_are_refused,
    a_switch_that_never_closes_is_not_found,
    a_switch_stuck_closed_is_told_from_a_stage_on_it,
    a_switch_that_sticks_after_the_first_edge_is_noticed,
    a_switch_that_dies_after_the_first_edge_is_noticed,
    two_edges_apart_are_no_reference,
    axes_are_homed_one_after_the_other_and_a_failure_leaves_the_first_its_reference,
    the_switch_of_another_axis_is_told_from_the_own,
    homing_works_again_after_a_failure,
    spikes_are_not_the_edge_of_the_switch,
    a_spike_at_the_start_does_not_move_a_stage_off_a_switch_that_it_is_not_on,
    a_chattering_contact_is_found_at_its_first_touch,
    a_switch_that_is_never_sure_ends_homing,
);

/// Ends and contacts do not contradict each other while they are changed one at a time, and nothing homes by such a mixture.
#[test]
fn an_end_that_is_not_where_the_switch_is_refuses_to_home() {
    for end in [HomeEnd::Low, HomeEnd::High] {
        let mut settings = Home(end, HomeSensor::NormallyOpen).settings();
        settings[1].switches.home_end = if end == HomeEnd::Low { HomeEnd::High } else { HomeEnd::Low };
        let mut world = World::with(settings, [100_000.0, 500_000.0]);
        assert_eq!(world.arm(), Status::Accepted);
        assert_eq!(world.home(BOTH), Status::Refused(Refusal::HomeSwitchAside { axis: 1 }));
        assert_eq!(world.home(FIRST), Status::Accepted);
        settings[0].switches.home_end = settings[1].switches.home_end;
        let mut world = World::with(settings, [100_000.0, 500_000.0]);
        assert_eq!(world.arm(), Status::Accepted);
        assert_eq!(world.home(AxisMask(2)), Status::Refused(Refusal::HomeSwitchAside { axis: 1 }));
    }
}

/// A normally closed switch shows a broken wire: it looks operated everywhere.
#[test]
fn a_broken_wire_of_a_normally_closed_switch_is_a_stuck_switch() {
    let home = Home(HomeEnd::Low, HomeSensor::NormallyClosed);
    let mut world = home.world([100_000.0, 500_000.0]);
    world.rig.axes[0].switch = HomeSwitch::StuckClosed;
    assert_eq!(world.arm(), Status::Accepted);
    assert_eq!(world.home(FIRST), Status::Accepted);
    assert_eq!(fault_of(&mut world).code, FaultCode::HomeSwitchStuck);
}
