//! The mechanics, with the interface of the controller.

use embassy_stm32::gpio::{Input, Output};
use embassy_time::Instant;
use vergence_control::joints::BusSettings;
use vergence_control::{DriverSettings, EncoderKind, IndexEdges, RigIo, StepSchedule, TriggerEdge};
use vergence_protocol::{AxisList, DriverState, EncoderState, Microseconds};

use crate::absolute::AbsoluteEncoders;
use crate::drivers;
use crate::encoder::Encoder;
use crate::index_lines::IndexLines;
use crate::joints::Joints;
use crate::steps::StepPulses;
use crate::trigger::Trigger;
use crate::wiring;

/// Number of axes that the board drives.
pub const AXES: usize = wiring::AXES.len();

/// What one axis is wired to.
pub struct Stage {
    /// Step and direction outputs.
    pub steps: StepPulses,
    /// Encoder.
    pub encoder: Encoder,
    /// Line of the home switch: low while its contact is closed, high while the output DIAG of a driver reports a stall.
    pub home_switch: Input<'static>,
    /// Line of the hard limit switch: high while its contact is open or the wire is broken.
    pub hard_limit: Input<'static>,
}

/// Motors, encoders, switches and trigger.
pub struct Rig {
    /// The axes.
    pub stages: [Stage; AXES],
    /// Index lines of the encoders.
    pub index_lines: IndexLines,
    /// Absolute encoders, which stand for the others where they are in use.
    pub absolute: AbsoluteEncoders,
    /// Emergency stop: normally closed (low), open (high) while pressed or when the wire is broken.
    pub emergency_stop: Input<'static>,
    /// Enable line of the drivers: low switches them on. The pull-up on the drivers' side keeps them off while the chip
    /// starts.
    pub drivers_off: Output<'static>,
    /// Asks the drivers for their holding current: high.
    pub holding: Output<'static>,
    /// Camera trigger.
    pub trigger: Trigger,
    /// A robot's joints, which stand for the stages where the board drives them.
    pub joints: Joints,
    /// The encoders as the running tick found them; `None` outside ticks.
    pub latched: Option<Latched>,
    /// The encoders as the latest two ticks found them, the older first.
    pub before: Latched,
    /// The later one.
    pub latest: Latched,
}

/// Counts of all encoders at one instant.
#[derive(Clone, Copy, Default)]
pub struct Latched {
    at: Microseconds,
    counts: [i32; AXES],
}

impl Rig {
    /// Reads the encoders and the clock: the tick that begins works with these. Its own work takes up to 0.4 ms, in which an
    /// axis moves on by 32 um.
    pub fn latch_encoders(&mut self) {
        let mut latched = critical_section::with(|_| Latched {
            counts: self.stages.each_ref().map(|stage| stage.encoder.count()),
            at: Microseconds(Instant::now().as_micros()),
        });
        // Some 10 us later for each absolute encoder.
        self.absolute.ask();
        for (axis, count) in latched.counts.iter_mut().enumerate() {
            *count = self.absolute.count(axis).unwrap_or(*count);
        }
        self.before = core::mem::replace(&mut self.latest, latched);
        self.latched = Some(latched);
        self.joints.latch();
    }

    /// Ends the tick: from now on encoders are read when they are asked for.
    pub fn release_encoders(&mut self) {
        self.latched = None;
        self.joints.release();
    }

    /// The count of an axis between the latest two ticks: an absolute encoder cannot be latched by an edge.
    fn between_ticks(&self, axis: usize, at: Microseconds) -> i32 {
        let count = |tick: &Latched| tick.counts.get(axis).copied().unwrap_or(0);
        let since = at.0.saturating_sub(self.before.at.0) as i64;
        let between = (self.latest.at.0.saturating_sub(self.before.at.0) as i64).max(1);
        let way = i64::from(count(&self.latest).wrapping_sub(count(&self.before)));
        count(&self.before).wrapping_add((way * since.min(between) / between) as i32)
    }

    /// Whether the board drives a robot's joints, which have no switches: the lines of those are open.
    fn has_joints(&self) -> bool {
        self.joints.states().is_some()
    }

    /// Starts the steps ordered for the tick that has begun. Returns whether the steps of the tick before were made in time.
    pub fn begin_tick(&mut self) -> bool {
        let mut in_time = true;
        let mut waits = [true; AXES];
        // No axis waits for the last pulse of another: its first step may be due before.
        while waits.contains(&true) {
            for (stage, waits) in self.stages.iter_mut().zip(&mut waits) {
                if *waits && stage.steps.is_ready() {
                    *waits = false;
                    in_time &= stage.steps.begin_tick();
                }
            }
        }
        self.trigger.poll();
        in_time
    }
}

impl RigIo for Rig {
    fn set_drivers(&mut self, on: bool) {
        if on {
            self.drivers_off.set_low();
        } else {
            self.drivers_off.set_high();
        }
        self.stages.iter_mut().for_each(|stage| stage.steps.abort());
        drivers::set_motors(on);
        self.joints.set_torque(on);
    }

    fn set_holding(&mut self, holding: bool) {
        self.holding.set_level(holding.into());
    }

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        if let Some(stage) = self.stages.get_mut(axis) {
            stage.steps.order(steps);
        }
    }

    fn set_goal(&mut self, axis: usize, counts: i32) {
        self.joints.set_goal(axis, counts);
    }

    fn steps(&self, axis: usize) -> i32 {
        self.stages.get(axis).map_or(0, |stage| stage.steps.count())
    }

    // Not inlined: copies of it in the controller would take 5 kB of flash.
    #[inline(never)]
    fn encoder(&self, axis: usize) -> i32 {
        if let Some(states) = self.joints.states() {
            return states.counts(axis);
        }
        match &self.latched {
            Some(latched) => latched.counts.get(axis).copied().unwrap_or(0),
            None => self.absolute.count(axis).or(self.stages.get(axis).map(|stage| stage.encoder.count())).unwrap_or(0),
        }
    }

    fn expect_counts(&mut self, axis: usize, per_second: u32) {
        if let Some(stage) = self.stages.get_mut(axis) {
            stage.encoder.expect(per_second);
        }
    }

    fn use_encoder(&mut self, axis: usize, kind: EncoderKind) {
        self.absolute.use_encoder(axis, kind);
    }

    fn encoder_state(&self, axis: usize) -> EncoderState {
        self.joints.states().map_or_else(|| self.absolute.state(axis), |states| states.encoder(axis))
    }

    fn take_index(&mut self, axis: usize) -> IndexEdges {
        self.index_lines.take(axis)
    }

    fn encoders_read_at(&self, now: Microseconds) -> Microseconds {
        match self.joints.states() {
            Some(states) => states.read_at().unwrap_or(now),
            None => self.latched.map_or(now, |latched| latched.at),
        }
    }

    fn home_switch(&self, axis: usize) -> bool {
        !self.has_joints() && self.stages.get(axis).is_some_and(|stage| stage.home_switch.is_low())
    }

    fn hard_limit(&self, axis: usize) -> bool {
        !self.has_joints() && self.stages.get(axis).is_some_and(|stage| stage.hard_limit.is_high())
    }

    fn emergency_stop(&self) -> bool {
        self.emergency_stop.is_high()
    }

    fn configure_drivers(&mut self, settings: &AxisList<DriverSettings>) {
        drivers::configure(settings);
    }

    fn configure_joints(&mut self, bus: Option<&BusSettings>) {
        self.joints.configure(bus);
    }

    fn driver(&self, axis: usize) -> DriverState {
        self.joints.states().map_or_else(|| drivers::state(axis), |states| states.driver(axis))
    }

    fn fire_trigger(&mut self, at: Microseconds) {
        self.trigger.fire(at);
        self.trigger.poll();
    }

    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        let (at, raw) = self.trigger.take_edge()?;
        if let Some(states) = self.joints.states() {
            let counts = (0..states.0.len()).map(|joint| states.counts_at(joint, at)).collect();
            return Some(TriggerEdge { at, counts });
        }
        let counts =
            self.stages.iter().zip(raw).enumerate().map(|(axis, (stage, raw))| match self.absolute.count(axis) {
                Some(_) => self.between_ticks(axis, at),
                None => stage.encoder.extended(raw),
            });
        let counts = counts.collect();
        Some(TriggerEdge { at, counts })
    }
}
