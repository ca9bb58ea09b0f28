//! Checks a robot's promises by the simulated mechanics.

use std::collections::VecDeque;
use std::fmt;

use vergence_plant::servo::{AnyMechanism, ServoBus};
use vergence_protocol::{Microseconds, PoseReport};
use vergence_rig::Rig;
use vergence_sim::DrivenTrunk;

/// A promise of a robot's board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobotPromise {
    /// Links do not touch.
    Clear,
    /// The links of the loop stay together.
    Closed,
    /// Servos have torque only while the board is armed and the emergency stop is released.
    Torque,
    /// After a fault of one joint the others hold.
    Holds,
    /// Reported positions are true.
    Position,
    /// A mode is reported only where the joints are in it.
    Mode,
    /// Harm is noticed and named, and what is no harm is no fault.
    Named,
    /// Every request is answered, every motion ends, and after its harm the robot can be used.
    Ends,
}

/// A broken promise.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotViolation {
    /// The true time.
    pub at: Microseconds,
    /// The promise.
    pub promise: RobotPromise,
    /// The observation that contradicts it.
    pub what: String,
}

impl fmt::Display for RobotViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.promise, self.what)
    }
}

/// Longest time from a cause to the end of all torque, in microseconds: a tick, an exchange, and its repetitions.
const TORQUE_OFF_US: u64 = 10_000;
/// Time in which joints brake after a fault, with the lag of their servos, in microseconds: v/a + 2a/j and some.
const BRAKING_US: u64 = 1_200_000;
/// How far a joint that holds may move, in radians: half a degree.
const HELD: f64 = 8.7e-3;
/// Largest error of a reported position at rest, in radians: a count, and the play between motor and output.
const READING: f64 = 8.0e-3;
/// Largest error of its time, in microseconds: the master counts the bytes' times rounded up.
const READING_US: f64 = 1_500.0;
/// Fastest joint in radians per second, with what a servo overshoots.
const FASTEST: f64 = 1.6;
/// How far from its mode a joint may be, in radians: tolerance of the board and play.
const IN_MODE: f64 = 1.4e-2;
/// Outputs that are kept, one each millisecond.
const KEPT: usize = 200;
/// Largest gap of the loop, by which it counts as closed.
const GAP: f64 = 1e-6;

/// The checker.
pub(super) struct Checker<'a> {
    rig: &'a Rig,
    violations: Vec<RobotViolation>,
    /// Outputs in the order of the axes, in radians, at true times.
    outputs: VecDeque<(Microseconds, Vec<f64>)>,
    /// Since when torque must be off; `None` while it may be on.
    forbidden_since: Option<Microseconds>,
    holding: Option<Holding>,
}

/// The joints that must hold.
struct Holding {
    lost: Option<usize>,
    since: Microseconds,
    places: Option<Vec<f64>>,
}

impl<'a> Checker<'a> {
    pub fn new(rig: &'a Rig) -> Self {
        let forbidden_since = Some(Microseconds(0));
        Self { rig, violations: Vec::new(), outputs: VecDeque::new(), forbidden_since, holding: None }
    }

    pub fn into_violations(self) -> Vec<RobotViolation> {
        self.violations
    }

    /// Notes a broken promise; each once.
    pub fn accuse(&mut self, at: Microseconds, promise: RobotPromise, what: String) {
        if self.violations.iter().all(|violation| violation.promise != promise) {
            self.violations.push(RobotViolation { at, promise, what });
        }
    }

    /// Torque may be on from now on.
    pub fn allow_torque(&mut self) {
        self.forbidden_since = None;
    }

    /// Torque must go off now.
    pub fn forbid_torque(&mut self, now: Microseconds) {
        self.forbidden_since = self.forbidden_since.or(Some(now));
        self.end_hold();
    }

    /// The joints need not hold any more.
    pub fn end_hold(&mut self) {
        self.holding = None;
    }

    /// All joints but `lost` must come to rest and hold.
    pub fn expect_hold(&mut self, now: Microseconds, lost: Option<usize>) {
        self.holding = Some(Holding { lost, since: now, places: None });
    }

    /// Looks at the mechanics; call it each millisecond.
    pub fn watch(&mut self, now: Microseconds, servos: &ServoBus<AnyMechanism>) {
        let outputs = self.outputs_of(servos);
        self.watch_trunk(now, servos);
        self.watch_torque(now, servos);
        self.watch_holding(now, servos, &outputs);
        if self.outputs.len() == KEPT {
            self.outputs.pop_front();
        }
        self.outputs.push_back((now, outputs));
    }

    fn watch_trunk(&mut self, now: Microseconds, servos: &ServoBus<AnyMechanism>) {
        let Some(driven) = servos.mechanism().get::<DrivenTrunk>() else { return };
        // A trunk without torque goes where its load pulls it.
        let is_held = servos.servos().iter().any(|servo| servo.has_torque());
        if let Some(touch) = driven.trunk().collisions().first().filter(|_| is_held) {
            let outputs =
                self.outputs_of(servos).iter().map(|angle| format!("{:.2}", angle.to_degrees())).collect::<Vec<_>>();
            let corners = driven.trunk().corners().map(|angle| format!("{:.2}", angle.to_degrees()));
            let what = format!("{touch:?} with outputs {} and corners {}", outputs.join(" "), corners.join(" "));
            self.accuse(now, RobotPromise::Clear, what);
        }
        let gap = driven.trunk().closure_error();
        if gap > GAP {
            self.accuse(now, RobotPromise::Closed, format!("the loop is open by {gap:.1e}"));
        }
    }

    fn watch_torque(&mut self, now: Microseconds, servos: &ServoBus<AnyMechanism>) {
        let Some(since) = self.forbidden_since.filter(|since| now.0 > since.0 + TORQUE_OFF_US) else { return };
        let powered = servos.servos().iter().find(|servo| servo.has_torque());
        if let Some(servo) = powered {
            let late = (now.0 - since.0) / 1_000;
            self.accuse(now, RobotPromise::Torque, format!("{:?} has torque {late} ms after its end", servo.id()));
        }
    }

    fn watch_holding(&mut self, now: Microseconds, servos: &ServoBus<AnyMechanism>, outputs: &[f64]) {
        let Some(holding) = &mut self.holding else { return };
        let lost = holding.lost;
        let torques = in_axes(self.rig, servos, |servo| servo.has_torque());
        let mut complaint = None;
        for (axis, has_torque) in torques.into_iter().enumerate().filter(|(axis, _)| Some(*axis) != lost) {
            if !has_torque {
                complaint = Some(format!("axis {axis} has let go"));
            }
        }
        if now.0 > holding.since.0 + BRAKING_US {
            let places = holding.places.get_or_insert_with(|| outputs.to_vec());
            for (axis, (here, there)) in outputs.iter().zip(places).enumerate() {
                // A lost joint may be pushed by the others; they must not give way.
                if Some(axis) != lost && (here - *there).abs() > HELD {
                    complaint = Some(format!("axis {axis} moves by {:.2} degrees", (here - *there).to_degrees()));
                }
            }
        }
        if let Some(what) = complaint {
            self.accuse(now, RobotPromise::Holds, what);
        }
    }

    /// Compares a pose with the mechanics; `at` is the true time of its reading, `doubted` an axis that cannot be read.
    pub fn judge(&mut self, now: Microseconds, at: Microseconds, pose: &PoseReport, doubted: Option<usize>) {
        let Some(outputs) = self.outputs_at(at) else { return };
        let [before, after] =
            [-READING_US, READING_US].map(|by| self.outputs_at(Microseconds((at.0 as f64 + by) as u64)));
        let reach = |axis: usize| {
            let moved = |other: &Option<Vec<f64>>| {
                other
                    .as_ref()
                    .and_then(|other| other.get(axis).zip(outputs.get(axis)))
                    .map_or(0.0, |(a, b)| (a - b).abs())
            };
            READING + moved(&before).max(moved(&after)).min(FASTEST * READING_US * 1e-6)
        };
        let mut complaint = None;
        for (index, ((axis, counts), output)) in self.rig.axes.iter().zip(&pose.counts).zip(&outputs).enumerate() {
            let error = axis.value_at(f64::from(counts.0)) - output;
            if pose.referenced.contains(index) && Some(index) != doubted && error.abs() > reach(index) {
                complaint = Some(format!("{} is reported {:.2} degrees off", axis.name, error.to_degrees()));
            }
        }
        if let Some(what) = complaint {
            self.accuse(now, RobotPromise::Position, what);
        }
        let mode = self.rig.modes.iter().find(|mode| mode.number == pose.mode);
        if let Some(mode) = mode {
            let off = |(target, output): (&vergence_rig::AxisPosition, &f64)| (target.value() - output).abs();
            let worst = mode.targets.iter().zip(&outputs).map(off).fold(0.0, f64::max);
            if worst > IN_MODE {
                let what = format!("{} is reported {:.2} degrees away", mode.name, worst.to_degrees());
                self.accuse(now, RobotPromise::Mode, what);
            }
        }
    }

    fn outputs_of(&self, servos: &ServoBus<AnyMechanism>) -> Vec<f64> {
        let shown = in_axes(self.rig, servos, |servo| servo.motor().output());
        self.rig.axes.iter().zip(shown).map(|(axis, shown)| axis.zero + axis.direction() * shown).collect()
    }

    fn outputs_at(&self, at: Microseconds) -> Option<Vec<f64>> {
        let next = self.outputs.partition_point(|(time, _)| *time < at);
        let (to, after) = self.outputs.get(next)?;
        let (from, before) = self.outputs.get(next.checked_sub(1)?)?;
        let share = (at.0 - from.0) as f64 / (to.0 - from.0).max(1) as f64;
        Some(before.iter().zip(after).map(|(before, after)| before + share * (after - before)).collect())
    }
}

/// Something of each servo, in the order of the axes.
fn in_axes<T: Default + Clone>(
    rig: &Rig,
    servos: &ServoBus<AnyMechanism>,
    of: impl Fn(&vergence_plant::servo::Servo) -> T,
) -> Vec<T> {
    let mut all = vec![T::default(); rig.axes.len()];
    let axes = rig.trunk.as_ref().map(|trunk| trunk.axes).unwrap_or_default();
    for (axis, servo) in axes.into_iter().zip(servos.servos()) {
        if let Some(slot) = all.get_mut(axis) {
            *slot = of(servo);
        }
    }
    all
}
