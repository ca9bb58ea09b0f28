//! The mutations: in `file`, below `firmware/control/src`, the text `from` stands once and becomes `to`.

/// A defect planted in the source of the controller.
pub struct Mutation {
    pub what: &'static str,
    pub file: &'static str,
    pub from: &'static str,
    pub to: &'static str,
}

const fn planted(what: &'static str, file: &'static str, from: &'static str, to: &'static str) -> Mutation {
    Mutation { what, file, from, to }
}

/// Defects that the scenarios find.
pub const CAUGHT: &[Mutation] = &[
    // Lease and faults.
    planted("a lease never ends", "lease.rs", "self.session == session && now < self.until", "self.session == session"),
    planted(
        "a lease is ten times as long",
        "lease.rs",
        "min(LONGEST_LEASE_MS)) * 1000",
        "min(LONGEST_LEASE_MS)) * 10_000",
    ),
    planted("nobody watches the lease", "controller/tick.rs", "self.watch_lease(now);\n        match", "match"),
    planted(
        "a lost link does not brake",
        "controller/tick.rs",
        "self.brake();\n        self.state = ControllerState::LinkLost;",
        "self.state = ControllerState::LinkLost;",
    ),
    planted(
        "any number clears a fault",
        "controller/requests.rs",
        "self.latch.record().is_none_or(|record| record.seq != seen)",
        "self.latch.record().is_none()",
    ),
    planted(
        "a cut leaves the drivers on",
        "controller/tick.rs",
        "self.abort_motion();\n        self.cut_drivers(io);",
        "self.abort_motion();",
    ),
    planted(
        "an idle board keeps its drivers on",
        "controller.rs",
        "self.drivers_on = false;\n        io.set_drivers(false);",
        "self.drivers_on = false;",
    ),
    // Arming and refusals.
    planted("arming needs no lease", "controller/requests.rs", "if !self.lease.is_live(now, session) {", "if false {"),
    planted("arming leaves the drivers off", "controller/requests.rs", "        io.set_drivers(true);\n", ""),
    planted("a move needs no reference", "controller/requests.rs", "if !axis.is_referenced() {", "if false {"),
    planted("a move has no range", "controller/requests.rs", "if !axis.settings.allows(position) {", "if false {"),
    planted("a jog has no range", "controller/requests.rs", "true => axis.settings.allows(target),", "true => true,"),
    planted(
        "a jog before homing has no end",
        "controller/requests.rs",
        "by.0.unsigned_abs() <= axis.settings.homing.travel.0.unsigned_abs()",
        "true",
    ),
    planted(
        "a board that takes an update can be armed",
        "controller/requests.rs",
        "ControllerState::Updating | ControllerState::Trial => Err(Refusal::Updating),\n            ControllerState::Boot",
        "ControllerState::Boot",
    ),
    // Inputs.
    planted(
        "hard limits are not watched",
        "controller/tick.rs",
        ".position(|axis| axis.limit().trips())",
        ".position(|_| false)",
    ),
    planted("the emergency stop is not watched", "controller/tick.rs", "if io.emergency_stop() {", "if false {"),
    planted("one reading is a contact", "contact.rs", "DEBOUNCE_TICKS: u8 = 5", "DEBOUNCE_TICKS: u8 = 1"),
    planted(
        "the latest closed reading is the edge",
        "contact.rs",
        "self.edge.get_or_insert(counts);",
        "self.edge = Some(counts);",
    ),
    planted("encoders are not watched", "controller/tick.rs", "            self.watch_following(now, io);\n", ""),
    // Motion.
    planted(
        "axes without reference are fast",
        "axis.rs",
        "if self.referenced { self.settings.limits() }",
        "if true { self.settings.limits() }",
    ),
    planted(
        "brakes are weak",
        "axis.rs",
        "Trajectory::stop(self.state(), self.settings.limits())",
        "Trajectory::stop(self.state(), self.settings.limits().scaled(0.3))",
    ),
    planted(
        "a stop is accepted and forgotten",
        "controller/requests.rs",
        "self.brake();\n                    self.state = ControllerState::Stopping;",
        "",
    ),
    planted("the counter of steps runs backwards", "steps.rs", "self.step += sign *", "self.step -= sign *"),
    planted(
        "the direction of steps is ignored",
        "axis.rs",
        "let forward = forward != self.settings.steps_reversed;",
        "let forward = true;",
    ),
    planted(
        "an axis that is off never gives up",
        "controller/settling.rs",
        "} else if now.0 - rests_since.0 >= SETTLE_TIMEOUT_US {",
        "} else if false {",
    ),
    planted(
        "the tolerance is fifty times as large",
        "axis.rs",
        "<= self.settings.tolerance.0.unsigned_abs()",
        "<= 50 * self.settings.tolerance.0.unsigned_abs()",
    ),
    planted(
        "an idle board still belongs to its session",
        "controller.rs",
        "self.cut_drivers(io);\n        self.holder = None;",
        "self.cut_drivers(io);",
    ),
    planted("every axis claims a reference", "axis.rs", "referenced: false,", "referenced: true,"),
    planted(
        "encoders count with the wrong sign",
        "axis.rs",
        "if self.settings.counts_reversed {",
        "if !self.settings.counts_reversed {",
    ),
    planted(
        "homing ends beyond the low end",
        "homing.rs",
        "axis.go_to(axis.settings.home_position(), limits);",
        "axis.go_to(Micro(axis.settings.min.0 - 100_000), limits);",
    ),
    planted(
        "motors are faster than their setting",
        "settings.rs",
        "Limits { speed: self.speed as f32, acceleration",
        "Limits { speed: 1.1 * self.speed as f32, acceleration",
    ),
    planted(
        "an edge is read a millisecond late",
        "contact.rs",
        "self.edge.get_or_insert(counts);\n",
        "if self.run > 2 {\n                self.edge.get_or_insert(counts);\n            }\n",
    ),
    planted(
        "a poll of a move never looks at the encoders",
        "controller.rs",
        "self.axes.iter().zip(&self.active.targets).all(|(axis, &target)| axis.is_at(target, io))",
        "io.encoder(0) != i32::MIN",
    ),
    // Homing.
    planted(
        "a search does not stop at its switch",
        "homing.rs",
        "axis.stop();\n                    Phase::Brake { edge }",
        "Phase::Brake { edge }",
    ),
    planted(
        "a search is as fast as a move",
        "homing.rs",
        "let limits = axis.settings.limits_at(homing.seek_speed);\n        let moving",
        "let limits = axis.settings.limits();\n        let moving",
    ),
    planted(
        "the slow approach is fast",
        "homing.rs",
        "axis.settings.limits_at(homing.approach_speed)",
        "axis.settings.limits_at(homing.seek_speed)",
    ),
    planted(
        "the reference is where the axis rests",
        "homing.rs",
        "axis.reference(io, edge, homing.switch_at);",
        "axis.reference(io, counts, homing.switch_at);",
    ),
    planted(
        "the reference is a millimetre off",
        "axis.rs",
        "counts_at(position));\n        self.referenced",
        "counts_at(Micro(position.0 + 1_000)));\n        self.referenced",
    ),
    // Settings.
    planted(
        "settings are not saved",
        "node/requests.rs",
        "settings_store::save(services.settings_flash(), &self.next_settings()).map_err(|_| Refusal::StorageFailed)?;",
        "let _ = services;",
    ),
    planted(
        "a changed setting has no effect",
        "node/requests.rs",
        "self.controller.replace_settings(&settings.axes).map_err(|_| Refusal::BadSetting)?;",
        "",
    ),
    // Reports.
    planted(
        "poses are late",
        "controller.rs",
        "            at: io.encoders_read_at(now),",
        "            at: Microseconds(io.encoders_read_at(now).0 + 2_000),",
    ),
    planted(
        "answers to probes have a wrong time",
        "node/requests.rs",
        "t1: received, t2: now }",
        "t1: Microseconds(received.0 + 5_000), t2: now }",
    ),
    planted(
        "pulses are reported late",
        "trigger.rs",
        "TriggerMark { seq: self.seq, at, counts }",
        "TriggerMark { seq: self.seq, at: Microseconds(at.0 + 3_000), counts }",
    ),
    planted(
        "a pulse reports the counts of its report",
        "node.rs",
        "self.controller.counts_from(&edge.counts)",
        "self.controller.pose(now, 0, io).counts",
    ),
];

/// Defects that no promise of the scenarios covers, and the tests that find them.
pub const HOLES: &[Mutation] = &[
    // A stop comes later than the plan, by the time that the line takes: firmware/control/tests/planning.rs.
    planted(
        "a stop does not end the plan that is being made",
        "controller.rs",
        "self.abort_motion();\n        self.planning = None;",
        "self.abort_motion();",
    ),
    // As before.
    planted(
        "a new target in the same plan is forgotten",
        "controller/planning.rs",
        "Some(planning) => planning.is_outdated = true,",
        "Some(_) => {}",
    ),
    // Two faults seldom follow each other before the first is cleared: firmware/control/tests/safety_stories.rs.
    planted(
        "the latest fault replaces the first",
        "latch.rs",
        "            return false;\n        }\n        let axis",
        "        }\n        let axis",
    ),
    // The largest following error still stops the axis, later and under another name: hil-sim/plant/tests/fault_stories.rs.
    planted(
        "disagreement is not looked for",
        "follow.rs",
        "if direction != 0\n            && let",
        "if false\n            && let",
    ),
    // As before.
    planted(
        "the largest following error is twenty times as large",
        "follow.rs",
        "let limit = i64::from(axis.following_error.0);\n        let [older",
        "let limit = 20 * i64::from(axis.following_error.0);\n        let [older",
    ),
    // No scenario pushes a stage away from its target: firmware/control/tests/safety_stories.rs.
    planted(
        "modes are reported wherever the axes are",
        "controller.rs",
        "self.active.phase == MovePhase::Settled && self.inside_tolerance(io)",
        "self.active.phase == MovePhase::Settled",
    ),
    // Such a search ends in another fault: firmware/control/tests/homing.rs.
    planted("the wires of switches are not compared", "homing_sequence.rs", "&& index != present {", "&& false {"),
    // Few scenarios save twice and restart then: firmware/control/tests/settings_store.rs.
    planted(
        "the older of two records is read",
        "settings_store.rs",
        "{ second } else { first })",
        "{ first } else { second })",
    ),
    // A late tick delays steps of the native board alike: tests/hil_late.rs shows what the chip loses.
    planted("late ticks are not judged", "controller/tick.rs", "if late > LATEST_US", "if late > 1_000_000"),
    // No scenario moves a stage by hand while the drivers are off: firmware/control/tests/moves.rs does.
    planted(
        "arming does not look where the axes are",
        "controller/requests.rs",
        "            axis.adopt_encoder(io);\n",
        "            let _ = &axis;\n",
    ),
    // It is cut again in the next tick: firmware/control/tests/safety_stories.rs.
    planted(
        "arming ignores the emergency stop",
        "controller/requests.rs",
        "        if io.emergency_stop() {\n            return Err(Refusal::CausePersists);\n        }\n        (0u8..)",
        "        (0u8..)",
    ),
    // The native board plans in no time: tests/hil_retarget.rs shows plans that come late.
    planted(
        "a plan begins wherever the axes are",
        "controller/planning.rs",
        "trajectories.len() == self.axes.len() && begins_here",
        "trajectories.len() == self.axes.len()",
    ),
];
