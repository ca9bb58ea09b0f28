//! One scenario of a robot from the first start to the last rest.

use vergence_protocol::{FaultRecord, Microseconds};
use vergence_rig::Rig;

use super::board::RobotBoard;
use super::checker::{RobotPromise, RobotViolation};
use super::harm::HarmKind;
use super::host::{Plan, RobotHost, Trouble};
use super::scenario::RobotScenario;
use crate::journal::Journal;

/// How long joints are watched after a fault, in microseconds.
const WATCHED_US: u64 = 2_500_000;
/// How long a host is gone, in microseconds.
const GONE_US: u64 = 2_500_000;
/// Attempts to bring the robot back to a mode after its harm.
const ATTEMPTS: u32 = 3;

/// The outcome of a scenario of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotOutcome {
    /// The fault that the board named, if any.
    pub fault: Option<FaultRecord>,
    /// Whether no path led back from where a blocked joint left the trunk.
    pub left_to_hands: bool,
    /// Broken promises, each once.
    pub violations: Vec<RobotViolation>,
    /// Duration in virtual time.
    pub virtual_time: Microseconds,
    /// The events.
    pub journal: Journal,
}

/// Runs `scenario` with a robot's board, just switched on.
pub fn run_robot(rig: &Rig, scenario: &RobotScenario, board: &mut impl RobotBoard) -> RobotOutcome {
    let plan = Plan {
        kind: scenario.kind,
        axis: scenario.axis,
        at: None,
        began: None,
        is_over: false,
        armed_loads: scenario.armed_loads,
    };
    let mut host = RobotHost::new(rig, board, plan);
    host.journal.note(Microseconds(0), format!("{scenario:?}"));
    let fault = match tour(&mut host, scenario) {
        Ok(()) => end_of_tour(&mut host, scenario),
        Err(trouble) => after_trouble(&mut host, scenario, trouble),
    };
    let (now, left_to_hands, mut journal) = (host.now, host.left_to_hands, host.journal);
    let violations = host.checker.into_violations();
    for violation in &violations {
        journal.note(violation.at, format!("VIOLATION: {violation}"));
    }
    RobotOutcome { fault, left_to_hands, violations, virtual_time: now, journal }
}

/// Connects, arms, and goes through the modes of the tour.
fn tour<B: RobotBoard>(host: &mut RobotHost<'_, B>, scenario: &RobotScenario) -> Result<(), Trouble> {
    host.connect()?;
    host.arm()?;
    for (number, &place) in scenario.tour.iter().enumerate() {
        if number == scenario.harm.0 {
            host.plan.at = Some(Microseconds(host.now.0 + scenario.harm.1));
        }
        host.go(place)?;
    }
    host.disarm()
}

/// The tour was made. What was no harm, or came too late, was no fault.
fn end_of_tour<B: RobotBoard>(host: &mut RobotHost<'_, B>, scenario: &RobotScenario) -> Option<FaultRecord> {
    host.wait(500_000);
    let fault = host.pose.as_ref().and_then(|pose| pose.fault);
    if let Some(fault) = fault.filter(|_| scenario.kind.names().is_empty()) {
        host.checker.accuse(host.now, RobotPromise::Named, format!("{fault:?} without harm"));
    }
    fault
}

/// The tour ended early: the fault must be that of the harm, and when the harm is over the robot can be used again.
fn after_trouble<B: RobotBoard>(
    host: &mut RobotHost<'_, B>,
    scenario: &RobotScenario,
    trouble: Trouble,
) -> Option<FaultRecord> {
    host.journal.note(host.now, format!("{trouble:?}"));
    let is_gone = !host.alive;
    let fault = match trouble {
        Trouble::Fault(fault) => {
            judge_fault(host, scenario, &fault);
            host.wait(WATCHED_US);
            Some(fault)
        }
        _ if is_gone => {
            host.checker.expect_hold(host.now, None);
            host.wait(GONE_US);
            None
        }
        Trouble::Restarted if scenario.kind.restarts_board() => None,
        Trouble::Restarted => {
            host.checker.accuse(host.now, RobotPromise::Ends, "the board has started anew by itself".into());
            None
        }
        Trouble::Stuck(why) | Trouble::NoPath(why) => {
            host.checker.accuse(host.now, RobotPromise::Ends, why);
            return None;
        }
    };
    if !host.plan.is_over {
        scenario.kind.end(host.board, scenario.axis);
        host.plan.is_over = true;
    }
    let mut outcome = Ok(());
    for attempt in 0..ATTEMPTS {
        let connects = attempt == 0 && (is_gone || scenario.kind.restarts_board());
        outcome = recover(host, scenario, connects);
        if outcome.is_ok() {
            break;
        }
        host.journal.note(host.now, format!("{outcome:?}"));
    }
    // A joint that was blocked on the way leaves the trunk in a shape of which the planner says that bodies touch: it is wider by the
    // plan than by the truth. The host is told, and somebody must move it by hand.
    if let Err(Trouble::NoPath(why)) = &outcome
        && scenario.kind == HarmKind::Blocked
    {
        host.journal.note(host.now, format!("left by hand: {why}"));
        host.left_to_hands = true;
    } else if let Err(trouble) = outcome {
        host.checker.accuse(host.now, RobotPromise::Ends, format!("after its harm: {trouble:?}"));
    }
    fault
}

fn judge_fault<B: RobotBoard>(host: &mut RobotHost<'_, B>, scenario: &RobotScenario, fault: &FaultRecord) {
    let names = scenario.kind.names();
    let is_begun = host.plan.began.is_some();
    let of_axis = !scenario.kind.is_of_joint() || fault.axis.map(usize::from) == Some(scenario.axis);
    if !is_begun || !names.contains(&fault.code) || !of_axis {
        host.checker.accuse(host.now, RobotPromise::Named, format!("{fault:?} for {}", scenario.kind.name()));
    }
    if scenario.kind.is_of_joint() {
        host.checker.expect_hold(host.now, Some(scenario.axis));
    }
}

/// Clears, arms, and goes back to the first mode of the tour.
fn recover<B: RobotBoard>(
    host: &mut RobotHost<'_, B>,
    scenario: &RobotScenario,
    connects: bool,
) -> Result<(), Trouble> {
    if connects {
        host.connect().or_else(|trouble| if matches!(trouble, Trouble::Fault(_)) { Ok(()) } else { Err(trouble) })?;
    }
    host.wait(20_000);
    host.clear()?;
    host.arm()?;
    host.go(scenario.tour.first().copied().unwrap_or_default())?;
    host.disarm()?;
    host.wait(200_000);
    Ok(())
}
