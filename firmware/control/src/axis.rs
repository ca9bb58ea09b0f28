//! One axis: command, encoder, reference and the trajectory it runs.

use vergence_protocol::{Counts, Micro, Microseconds};

use crate::TICK_US;
use crate::io::{MAX_STEPS_PER_TICK, RigIo, StepSchedule};
use crate::profile::{Limits, Profile};
use crate::settings::AxisSettings;
use crate::trajectory::Trajectory;

#[derive(Clone, Debug)]
pub struct Axis {
    pub settings: AxisSettings,
    index: usize,
    /// Where the axis was told to be now, and at the end of the running tick; 1/256 micro-units.
    command_now: i64,
    command_next: i64,
    /// When the axis will be at `command_next`: a new trajectory begins there and then, so that the command never jumps.
    next_at: Microseconds,
    trajectory: Option<Trajectory>,
    /// Raw counts at the axis zero.
    zero_counts: i32,
    referenced: bool,
}

impl Axis {
    pub fn new(index: usize, settings: AxisSettings) -> Self {
        Self {
            settings,
            index,
            command_now: 0,
            command_next: 0,
            next_at: Microseconds(0),
            trajectory: None,
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

    /// The encoder's count, rising along the axis.
    fn raw_counts(&self, io: &impl RigIo) -> i32 {
        let raw = io.encoder(self.index);
        if self.settings.counts_reversed { raw.wrapping_neg() } else { raw }
    }

    pub fn counts(&self, io: &impl RigIo) -> Counts {
        Counts(self.raw_counts(io).wrapping_sub(self.zero_counts))
    }

    pub fn position(&self, io: &impl RigIo) -> Micro {
        self.settings.encoder().position_at(self.counts(io).0)
    }

    /// Declares that the encoder count `edge` is at `position`.
    pub fn reference(&mut self, io: &impl RigIo, edge: Counts, position: Micro) {
        let raw_edge = edge.0.wrapping_add(self.zero_counts);
        self.zero_counts = raw_edge.wrapping_sub(self.settings.encoder().counts_at(position));
        self.referenced = true;
        self.adopt_encoder(io);
    }

    /// Takes the encoder's word for where the axis is: after power-on, after the drivers were off, after homing.
    /// Without reference that is zero: raw counts may be anywhere, beyond what a position can say.
    pub fn adopt_encoder(&mut self, io: &impl RigIo) {
        if !self.referenced {
            self.zero_counts = self.raw_counts(io);
        }
        let position = self.position(io);
        self.trajectory = None;
        self.command_now = i64::from(position.0) << 8;
        self.command_next = self.command_now;
    }

    /// Starts a profile from the present command.
    pub fn run(&mut self, now: Microseconds, profile: Profile) {
        self.trajectory = Some(Trajectory::new(self.command_next, now.max(self.next_at), profile));
    }

    /// Starts a motion by `distance` from rest.
    pub fn travel(&mut self, now: Microseconds, distance: Micro, limits: Limits) {
        self.run(now, Profile::rest_to_rest(distance.0 as f32, limits));
    }

    /// The profile from rest at the present command to `target`.
    pub fn profile_to(&self, target: Micro, limits: Limits) -> Profile {
        let distance = (i64::from(target.0) << 8) - self.command_next;
        Profile::rest_to_rest(distance as f32 / 256.0, limits)
    }

    /// Begins the quickest stop; at rest it does nothing.
    pub fn stop(&mut self, now: Microseconds) {
        if let Some(trajectory) = self.trajectory {
            let state = trajectory.state(now.max(self.next_at));
            self.run(now, Profile::stop(state.velocity, state.acceleration, self.settings.limits()));
        }
    }

    /// Drops the trajectory where it is: for drivers that have been switched off.
    pub fn abandon(&mut self) {
        self.trajectory = None;
    }

    pub fn is_moving(&self) -> bool {
        self.trajectory.is_some()
    }

    /// Commands the next tick.
    pub fn advance(&mut self, now: Microseconds, io: &mut impl RigIo) {
        let end_of_tick = Microseconds(now.0 + TICK_US);
        self.command_now = self.command_next;
        self.next_at = end_of_tick;
        if let Some(trajectory) = self.trajectory {
            self.command_next = trajectory.position(end_of_tick);
            if trajectory.is_over(end_of_tick) {
                self.trajectory = None;
            }
        }
        let motor = self.settings.motor();
        let by = motor.counts_at_q8(self.command_next).wrapping_sub(motor.counts_at_q8(self.command_now));
        io.schedule_steps(self.index, &evenly(now, by, self.settings.steps_reversed));
    }

    /// Command less encoder.
    pub fn following_error(&self, io: &impl RigIo) -> i32 {
        let command = i32::try_from(self.command_now >> 8).unwrap_or(i32::MAX);
        command.saturating_sub(self.position(io).0)
    }

    /// Whether the encoder reads `target` within the tolerance.
    pub fn is_at(&self, target: Micro, io: &impl RigIo) -> bool {
        self.position(io).0.abs_diff(target.0) <= self.settings.tolerance.0.unsigned_abs()
    }

    pub fn home_switch(&self, io: &impl RigIo) -> bool {
        io.home_switch(self.index)
    }
}

/// So many steps, evenly over a tick.
fn evenly(start: Microseconds, by: i32, reversed: bool) -> StepSchedule {
    let count = by.unsigned_abs().min(MAX_STEPS_PER_TICK as u32);
    let at_ns = (0..count).map(|step| (2 * step + 1) * TICK_US as u32 * 500 / count).collect();
    StepSchedule { start, forward: (by > 0) != reversed, at_ns }
}
