//! One axis: command, encoder, reference and the trajectory it runs.

use vergence_protocol::{Counts, EncoderState, Micro, Microseconds};

use crate::TICK_US;
use crate::follow::{Following, Lost};
use crate::hard_limit::HardLimit;
use crate::index::IndexWatch;
use crate::io::{RigIo, StepSchedule};
use crate::move_planner::PlannedWay;
use crate::plan::{AxisPlanner, PlanStart};
use crate::profile::Limits;
use crate::settings::AxisSettings;
use crate::steps::{Instants, StepCounter};
use crate::switches::StallLine;
use crate::trajectory::{FINE_BITS, Fine, MotionState, Trajectory};

/// Largest change of a joint's lean in a tick, in micro-units: 11 degrees in a second.
const LEAN_RATE: i32 = 200;

#[derive(Clone, Debug)]
pub struct Axis {
    pub settings: AxisSettings,
    index: usize,
    /// Commanded positions: now, at the end of the running tick, and at the end of the next one. Steps are ordered one tick
    /// ahead, and a new trajectory begins where the last order ends, so that the command never jumps.
    command: [Fine; 3],
    motor: StepCounter,
    following: Following,
    limit: HardLimit,
    stall: StallLine,
    index_pulses: IndexWatch,
    trajectory: Option<Trajectory>,
    /// Part of the trajectory that has been ordered, in microseconds.
    elapsed: u64,
    /// Whether the axis rests at its command with the play taken up from below.
    from_below: bool,
    /// How far the goal of a joint's servo lies beyond the command, now and soon, in micro-units: its servo rests off its goal by
    /// load and stiffness.
    lean: [Micro; 2],
    /// Raw counts at the axis zero.
    zero_counts: i32,
    referenced: bool,
}

impl Axis {
    pub fn new(index: usize, settings: AxisSettings) -> Self {
        Self {
            settings,
            index,
            command: [0; 3],
            motor: StepCounter::new(settings.motor(), 0),
            following: Following::default(),
            limit: HardLimit::default(),
            stall: StallLine::default(),
            index_pulses: IndexWatch::default(),
            trajectory: None,
            elapsed: 0,
            from_below: false,
            lean: [Micro(0); 2],
            zero_counts: 0,
            referenced: false,
        }
    }

    pub fn is_referenced(&self) -> bool {
        self.referenced
    }

    pub fn forget_reference(&mut self) {
        self.referenced = false;
    }

    /// The encoder's raw count, with the sign that rises along the axis.
    fn raw_counts(&self, io: &impl RigIo) -> i32 {
        self.rising(io.encoder(self.index))
    }

    fn rising(&self, raw: i32) -> i32 {
        if self.settings.counts_reversed { raw.wrapping_neg() } else { raw }
    }

    pub fn counts(&self, io: &impl RigIo) -> Counts {
        self.counts_from(io.encoder(self.index))
    }

    /// Converts a raw encoder count to counts from the axis zero.
    pub fn counts_from(&self, raw: i32) -> Counts {
        Counts(self.rising(raw).wrapping_sub(self.zero_counts))
    }

    pub fn position(&self, io: &impl RigIo) -> Micro {
        self.settings.encoder().position_at(self.counts(io).0)
    }

    /// Commanded position at the end of the last tick whose steps are ordered.
    pub fn command(&self) -> Fine {
        self.command[2]
    }

    /// Sets the axis zero so that the encoder count `edge` is at `position`.
    pub fn reference(&mut self, io: &impl RigIo, edge: Counts, position: Micro) {
        let raw_edge = edge.0.wrapping_add(self.zero_counts);
        self.zero_counts = raw_edge.wrapping_sub(self.settings.encoder().counts_at(position));
        self.referenced = true;
        self.index_pulses = IndexWatch::begin(io.encoder(self.index));
        self.adopt_encoder(io);
    }

    /// Sets the axis zero by an absolute encoder: of the places that read the same, the one nearest to the middle of the range.
    pub fn reference_absolutely(&mut self, io: &impl RigIo) {
        let (settings, turn) = (&self.settings, self.settings.feedback.turn().cast_signed());
        let middle = settings.encoder().counts_at(Micro(settings.min.0 / 2 + settings.max.0 / 2));
        let raw = self.raw_counts(io);
        let from_zero = raw.wrapping_sub(self.rising(settings.feedback.zero.cast_signed()));
        let from_middle = (from_zero.wrapping_sub(middle).wrapping_add(turn / 2)).rem_euclid(turn) - turn / 2;
        self.zero_counts = raw.wrapping_sub(middle.wrapping_add(from_middle));
        self.referenced = true;
        self.adopt_encoder(io);
    }

    /// While the motors are off: an axis with an absolute encoder knows where it is as long as its encoder answers.
    #[inline(never)]
    pub fn follow_encoder(&mut self, io: &impl RigIo) {
        if self.settings.feedback.is_absolute() {
            let is_usable = io.encoder_state(self.index).is_usable();
            match (self.referenced, is_usable) {
                (false, true) => self.reference_absolutely(io),
                (true, false) => self.forget_reference(),
                _ => {}
            }
        }
    }

    /// What is known of the encoder beyond its count.
    pub fn encoder_state(&self, io: &impl RigIo) -> EncoderState {
        match (self.settings.feedback.is_absolute(), self.settings.feedback.index_every) {
            (true, _) => io.encoder_state(self.index),
            (false, 0) => EncoderState::Plain,
            (false, _) => self.index_pulses.state(),
        }
    }

    /// Checks the count at the index pulses; call it once each tick. Returns the fault, if any.
    pub fn watch_index(&mut self, io: &mut impl RigIo) -> Option<Lost> {
        let edges = io.take_index(self.index);
        let every = self.settings.feedback.index_every;
        if every == 0 || !self.referenced {
            return None;
        }
        let most = self.settings.largest_drift();
        self.index_pulses.watch(every, most, io.encoder(self.index), &edges)
    }

    /// Sets the command to the encoder's position: after power-on, after the drivers were off, after homing. Without
    /// reference that is zero, because raw counts may be beyond the range of a position.
    pub fn adopt_encoder(&mut self, io: &impl RigIo) {
        if !self.referenced {
            self.zero_counts = self.raw_counts(io);
        }
        self.rest_at_encoder(io);
    }

    /// Ends all motion at once, with the command at the encoder's position: after a press against an end stop.
    pub fn rest_at_encoder(&mut self, io: &impl RigIo) {
        let position = fine_from(self.position(io));
        self.trajectory = None;
        self.from_below = false;
        self.lean = [Micro(0); 2];
        self.command = [position; 3];
        self.motor = StepCounter::new(self.settings.motor(), position);
        self.following = Following::default();
    }

    /// State at which a new trajectory begins.
    fn state(&self) -> MotionState {
        self.state_after(0)
    }

    /// State at which a trajectory begins that is started in so many ticks, where nothing else is started before.
    pub fn state_after(&self, ticks: u32) -> MotionState {
        match &self.trajectory {
            Some(trajectory) => trajectory.state(Microseconds(self.elapsed + u64::from(ticks) * TICK_US)),
            None => MotionState::at(self.command()),
        }
    }

    /// Starts a trajectory that begins at the present state.
    pub fn run(&mut self, trajectory: Trajectory) {
        self.from_below = false;
        self.elapsed = 0;
        self.trajectory = Some(trajectory).filter(|trajectory| trajectory.duration() > 0.0);
    }

    /// Starts a motion by `distance` from rest.
    pub fn travel(&mut self, distance: Micro, limits: Limits) {
        let target = self.command() + fine_from(distance);
        self.run(Trajectory::reach(self.state(), target, limits, 0.0));
    }

    /// Starts a motion to `target` from rest.
    pub fn go_to(&mut self, target: Micro, limits: Limits) {
        self.run(Trajectory::reach(self.state(), fine_from(target), limits, 0.0));
    }

    /// The way to `target` of a plan that begins in so many ticks.
    pub fn way(&self, ticks: u32, target: Micro) -> PlannedWay {
        // Without reference the low end of the range may be out of reach, so play is not taken up.
        let backlash = if self.referenced { self.settings.backlash } else { Micro(0) };
        let planner = AxisPlanner { limits: self.speed_limits(), backlash };
        let start = PlanStart { motion: self.state_after(ticks), from_below: self.from_below };
        PlannedWay { planner, start, target }
    }

    /// Starts a planned motion, which begins at the present state and rests at its target until `together` seconds have
    /// passed.
    pub fn run_planned(&mut self, trajectory: &Trajectory, together: f32) {
        let from_below = self.referenced;
        if trajectory.duration() > 0.0 {
            self.run(trajectory.clone());
            if let Some(running) = &mut self.trajectory {
                running.rest_until(together);
            }
        }
        self.from_below = from_below;
    }

    fn speed_limits(&self) -> Limits {
        // Without reference the way may be blocked.
        if self.referenced { self.settings.limits() } else { self.settings.limits_at(self.settings.homing.seek_speed) }
    }

    /// Starts the quickest stop; at rest it does nothing.
    pub fn stop(&mut self) {
        if self.trajectory.is_some() {
            self.run(Trajectory::stop(self.state(), self.settings.limits()));
        }
    }

    /// Drops the trajectory at the present command, after the drivers were switched off.
    pub fn abandon(&mut self) {
        self.trajectory = None;
        self.command = [self.command[0]; 3];
    }

    /// Whether steps are still to be made.
    pub fn is_moving(&self) -> bool {
        self.trajectory.is_some() || self.command != [self.command[0]; 3]
    }

    /// Orders the steps of the tick after the one that begins now.
    pub fn advance(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let [_, running, ordered] = self.command;
        self.command = [running, ordered, ordered];
        if self.settings.is_joint() {
            return self.advance_joint(io);
        }
        let Some(trajectory) = &self.trajectory else { return };
        let (from, to) = (Microseconds(self.elapsed), Microseconds(self.elapsed + TICK_US));
        let end = trajectory.state(to).position;
        let (forward, at_ns) = self.motor.follow(trajectory.pieces(from, to), end);
        self.command[2] = end;
        self.elapsed = to.0;
        if trajectory.is_over(to) {
            self.trajectory = None;
        }
        self.order(Microseconds(now.0 + TICK_US), forward, at_ns, io);
    }

    /// A joint gets the place where it shall be at the end of the tick after this one, at rest too: its servo holds it there.
    fn advance_joint(&mut self, io: &mut impl RigIo) {
        if let Some(trajectory) = &self.trajectory {
            let to = Microseconds(self.elapsed + TICK_US);
            self.command[2] = trajectory.state(to).position;
            self.elapsed = to.0;
            if trajectory.is_over(to) {
                self.trajectory = None;
            }
        }
        let [now, soon] = self.lean.map(|lean| lean.0);
        self.lean[0] = Micro(soon.clamp(now.saturating_sub(LEAN_RATE), now.saturating_add(LEAN_RATE)));
        let goal = Micro(micro_from(self.command[2]).0.saturating_add(self.lean[0].0));
        let counts = self.settings.encoder().counts_at(goal).wrapping_add(self.zero_counts);
        io.set_goal(self.index, self.rising(counts));
    }

    /// Makes the servo of a joint at rest push against its load, so that it comes to rest at `target`.
    pub fn lean_towards(&mut self, target: Micro, io: &impl RigIo) {
        let most = self.settings.correction.0;
        let lean = self.lean[1].0.saturating_add(self.error(target, io).0);
        self.lean[1] = Micro(lean.clamp(-most, most));
    }

    fn order(&self, start: Microseconds, forward: bool, at_ns: Instants, io: &mut impl RigIo) {
        if !at_ns.is_empty() {
            let forward = forward != self.settings.steps_reversed;
            io.schedule_steps(self.index, &StepSchedule { start, forward, at_ns });
        }
    }

    /// Compares encoder and command; call it once each tick. Returns the fault, if any.
    pub fn watch(&mut self, io: &impl RigIo) -> Option<Lost> {
        let (counts, position) = (self.counts(io), self.position(io));
        let command = micro_from(self.command[0]);
        match self.settings.is_joint() {
            true => self.following.watch_joint(&self.settings, command, position, counts),
            false => self.following.watch(&self.settings, command, position, counts),
        }
    }

    /// Commanded position, rounded to micro-units.
    pub fn commanded(&self) -> Micro {
        micro_from(self.command())
    }

    /// Target minus encoder.
    pub fn error(&self, target: Micro, io: &impl RigIo) -> Micro {
        Micro(target.0.saturating_sub(self.position(io).0))
    }

    /// Whether the encoder reads `target` within the tolerance.
    pub fn is_at(&self, target: Micro, io: &impl RigIo) -> bool {
        self.error(target, io).0.unsigned_abs() <= self.settings.tolerance.0.unsigned_abs()
    }

    /// Reads the hard limit; call it once each tick.
    pub fn read_limit(&mut self, io: &impl RigIo) {
        // A joint has no switches: the lines of their inputs are open.
        if self.settings.is_joint() {
            return;
        }
        let motion = (self.command[2] - self.command[0]).signum();
        let is_reached = self.settings.switches.is_limit(io.hard_limit(self.index));
        self.limit.read(is_reached, self.raw_counts(io), motion);
    }

    pub fn limit(&self) -> &HardLimit {
        &self.limit
    }

    /// Notes that somebody knows of the hard limit, if it is reached.
    pub fn acknowledge_limit(&mut self) {
        self.limit.acknowledge();
    }

    /// Whether the axis may move by `distance` as far as its hard limit is concerned.
    pub fn limit_lets_go(&self, distance: Micro, io: &impl RigIo) -> bool {
        let from = self.settings.encoder().position_at(self.raw_counts(io).wrapping_sub(self.limit.met_at())).0;
        let retract = self.settings.homing.retract.0;
        let to = i64::from(from) + i64::from(distance.0);
        !self.limit.is_reached() || self.limit.lets_go(from.into(), to, retract.into())
    }

    /// Whether the home switch is operated, or the motor driver on its line reports a stall.
    pub fn home_switch(&self, io: &impl RigIo) -> bool {
        self.settings.switches.is_home(io.home_switch(self.index))
    }

    /// Reads whether the motor driver reports a stall while the speed is constant; call it once each tick.
    pub fn reads_stall(&mut self, io: &impl RigIo) -> bool {
        let MotionState { velocity, acceleration, .. } = self.state();
        self.stall.read(self.home_switch(io), velocity != 0 && acceleration == 0)
    }

    /// Whether the speed had been constant for so long at the last reading that a missing report says something.
    pub fn stall_may_be_judged(&self) -> bool {
        self.stall.may_be_judged()
    }
}

fn fine_from(position: Micro) -> Fine {
    Fine::from(position.0) << FINE_BITS
}

/// The nearest micro-unit; saturates.
fn micro_from(position: Fine) -> Micro {
    let rounded = (position + (1 << (FINE_BITS - 1))) >> FINE_BITS;
    Micro(i32::try_from(rounded).unwrap_or(if rounded < 0 { i32::MIN } else { i32::MAX }))
}
