//! Checks of what the board reports: poses, faults, times, pulses.

use vergence_plant::Plant;
use vergence_protocol::{
    AxisMask, ControllerState, Counts, FaultRecord, Microseconds, Mode, MovePhase, PoseReport, Report, TriggerMark,
};

use super::Checker;
use crate::journal::Journal;
use crate::promise::Promise;
use crate::pulses::LOOK_US;
use crate::watched_axis::WatchedAxis;

/// The control tick, in microseconds.
const TICK_US: u64 = 1_000;
/// Time within which a pose leaves the board, beside the delay of the board itself.
const POSE_US: u64 = 1_000;
/// Largest error of the instant at which encoders are latched by a pulse: the step of the simulated mechanics.
const PULSE_US: u64 = 20;
/// States of a disarmed board.
const OFF: [ControllerState; 5] = [
    ControllerState::Idle,
    ControllerState::Boot,
    ControllerState::SelfTest,
    ControllerState::Updating,
    ControllerState::Trial,
];

impl Checker {
    /// Checks a frame that leaves the board.
    pub fn received_from_board(&mut self, now: Microseconds, bytes: &[u8], plant: &Plant, journal: &mut Journal) {
        for &byte in bytes {
            let Some(frame) = self.from_board.push(byte) else { continue };
            match frame.body::<Report>() {
                Ok(Report::Pose(pose)) => self.check_pose(now, &pose, plant, journal),
                Ok(Report::Fault(record)) => {
                    journal.note(now, format!("board: {}: {record:?}", record.code));
                    self.check_fault(now, Some(record));
                }
                Ok(Report::Ack { to, status }) => self.settings.answered(to, status),
                Ok(Report::TimeReply { t0, t1, t2 }) => self.check_times(now, t0, [t1, t2]),
                Ok(Report::TriggerMark(mark)) => self.marks.push_back((now.0, mark)),
                _ => {}
            }
        }
    }

    fn check_pose(&mut self, now: Microseconds, pose: &PoseReport, plant: &Plant, journal: &mut Journal) {
        if self.state.replace(pose.state) != Some(pose.state) {
            journal.note(now, format!("board: {}, loads {:.1?}", pose.state, plant.loads()));
        }
        let busy = matches!(pose.state, ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping);
        self.busy_since = if busy { self.busy_since.or(Some(now.0)) } else { None };
        self.referenced = pose.referenced;
        if let Some(what) = self.clock.note_before(pose.at.0, now.0) {
            self.accuse(now, Promise::Clock, format!("of a pose: {what}"));
        }
        let ticks = (POSE_US + self.delay_us).div_ceil(TICK_US) as usize;
        self.check_counts(now, Promise::Position, &pose.counts, |_, axis, counts| axis.check_pose(counts, ticks));
        self.check_fault(now, pose.fault);
        self.check_state(now, pose, plant);
        if pose.mode != Mode(0)
            && let Some(what) = self.wrong_mode(pose)
        {
            self.accuse(now, Promise::Mode, what);
        }
        if std::mem::take(&mut self.restarted) {
            // The self-test may have found a fault since.
            let new_fault = pose.fault.is_none_or(|fault| fault.seq == 1 && fault.at <= pose.at);
            let fresh = pose.referenced == AxisMask(0) && pose.phase == MovePhase::None && new_fault;
            if !fresh {
                self.accuse(now, Promise::State, format!("remembers what was before its start: {pose:?}"));
            }
        }
    }

    /// Checks reported counts of the axes with a reference.
    fn check_counts(
        &mut self,
        now: Microseconds,
        promise: Promise,
        counts: &[Counts],
        check: impl Fn(usize, &WatchedAxis, Counts) -> Option<String>,
    ) {
        let referenced = self.axes.iter().zip(counts).enumerate().filter(|(index, _)| self.referenced.contains(*index));
        let wrong = referenced
            .filter_map(|(index, (axis, &counts))| Some((index, check(index, axis, counts)?)))
            .map(|(index, what)| format!("axis {index}: {what}"))
            .next();
        if let Some(what) = wrong {
            self.accuse(now, promise, what);
        }
    }

    /// Checks the answer to a clock probe: it arrived at `t1` and was answered at `t2`, by the board's clock.
    fn check_times(&mut self, now: Microseconds, t0: Microseconds, [t1, t2]: [Microseconds; 2]) {
        let arrived = self.probes.iter().filter(|(probe, _)| *probe == t0).map(|(_, at)| *at).min();
        let Some(arrived) = arrived else {
            return self.accuse(now, Promise::Clock, format!("an answer to a probe at {t0:?} that nobody sent"));
        };
        let wrong = self.clock.note(t1.0, arrived, now.0).or_else(|| self.clock.note(t2.0, arrived, now.0));
        let wrong = wrong.or_else(|| (t2 < t1).then(|| format!("answered at {t2:?} before {t1:?}")));
        if let Some(what) = wrong {
            self.accuse(now, Promise::Clock, what);
        }
    }

    /// Checks the reports of pulses once the mechanics must have shown them.
    pub(super) fn check_pulses(&mut self, now: Microseconds) {
        while let Some((_, mark)) = self.marks.pop_front_if(|(came, _)| now.0 >= *came + LOOK_US) {
            self.check_pulse(now, &mark);
        }
    }

    fn check_pulse(&mut self, now: Microseconds, mark: &TriggerMark) {
        match self.pulses.loads_at(mark.at.0, &mut self.clock).map(|loads| loads.map(<[f64]>::to_vec)) {
            Ok(Some(loads)) => self.check_counts(now, Promise::Trigger, &mark.counts, |index, axis, counts| {
                let load = *loads.get(index)?;
                // Encoders are latched within a step of the simulated mechanics.
                let moved = f64::from(axis.stage.settings.speed) * PULSE_US as f64 * 1e-6;
                axis.check_counts(counts, [load - moved, load + moved])
            }),
            Ok(None) => {}
            Err(what) => self.accuse(now, Promise::Trigger, what),
        }
    }

    /// Checks that the first fault stays unchanged until it is cleared by its number.
    fn check_fault(&mut self, now: Microseconds, reported: Option<FaultRecord>) {
        if let Some(first) = self.fault {
            let kept = reported.is_some_and(|reported| {
                reported.later >= first.later && FaultRecord { later: first.later, ..reported } == first
            });
            if !kept && self.clear_asked != Some(first.seq) {
                self.accuse(now, Promise::FirstFault, format!("{first:?} became {reported:?}"));
            }
        }
        self.fault = reported;
    }

    fn check_state(&mut self, now: Microseconds, pose: &PoseReport, plant: &Plant) {
        let latched = matches!(pose.state, ControllerState::LinkLost | ControllerState::Fault);
        if latched != pose.fault.is_some() {
            self.accuse(now, Promise::FirstFault, format!("state {} with fault {:?}", pose.state, pose.fault));
        }
        // While a fault is latched, the drivers may be on or off.
        let off = OFF.contains(&pose.state);
        let settled = now.0 >= self.switched_at + self.delay_us;
        if !latched && settled && off == plant.drivers_on() {
            let on = plant.drivers_on();
            self.accuse(now, Promise::State, format!("{} while drivers on is {on}", pose.state));
        }
    }

    /// Returns the contradiction to a reported mode; `None` where it is true.
    fn wrong_mode(&self, pose: &PoseReport) -> Option<String> {
        let Some((_, mode, targets)) = self.moves.iter().find(|(id, ..)| *id == pose.move_id) else {
            return Some(format!("mode {:?} of a move that nobody asked for", pose.mode));
        };
        if *mode != pose.mode {
            return Some(format!("mode {:?} of a move to {mode:?}", pose.mode));
        }
        let mut pairs = self.axes.iter().zip(targets).enumerate();
        pairs.find_map(|(index, (axis, target))| {
            let (off, allowed) = (axis.load - f64::from(target.0), axis.mode_tolerance());
            (off.abs() > allowed).then(|| format!("{mode:?} but axis {index} is off by {off:.1} of {allowed:.1}"))
        })
    }
}
