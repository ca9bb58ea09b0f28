//! The mechanics, with the interface of the controller.

use embassy_stm32::gpio::{Input, Output};
use vergence_control::{RigIo, StepSchedule, TriggerEdge};
use vergence_protocol::Microseconds;

use crate::encoder::Encoder;
use crate::steps::StepPulses;
use crate::trigger::Trigger;

/// Number of axes that the board drives.
pub const AXES: usize = 2;

/// Motors, encoders, switches and trigger.
pub struct Rig {
    /// Step and direction outputs of each axis.
    pub steps: [StepPulses; AXES],
    /// Encoder of each axis.
    pub encoders: [Encoder; AXES],
    /// Home switches: closed (low) at home.
    pub home_switches: [Input<'static>; AXES],
    /// Hard limit switches: normally closed (low), open (high) beyond the range or when the wire is broken.
    pub hard_limits: [Input<'static>; AXES],
    /// Emergency stop: normally closed (low), open (high) while pressed or when the wire is broken.
    pub emergency_stop: Input<'static>,
    /// Enable line of the drivers: low switches them on. The pull-up on the drivers' side keeps them off while the chip
    /// starts.
    pub drivers_off: Output<'static>,
    /// Camera trigger.
    pub trigger: Trigger,
    /// Counts of the encoders at the start of the running tick; `None` between two ticks.
    pub latched: Option<[i32; AXES]>,
}

impl Rig {
    /// Latches the encoders and starts the steps ordered for the tick that has begun. Returns whether the steps of the tick
    /// before were made in time.
    pub fn begin_tick(&mut self) -> bool {
        // The pose of a tick names its start, and is made up to 0.4 ms later.
        self.latched = Some(self.encoders.each_ref().map(Encoder::count));
        let mut in_time = true;
        for axis in &mut self.steps {
            in_time &= axis.begin_tick();
        }
        self.trigger.poll();
        in_time
    }

    /// Reads the encoders themselves again, until the next tick.
    pub fn end_tick(&mut self) {
        self.latched = None;
    }
}

impl RigIo for Rig {
    fn set_drivers(&mut self, on: bool) {
        if on {
            self.drivers_off.set_low();
        } else {
            self.drivers_off.set_high();
        }
        self.steps.iter_mut().for_each(StepPulses::abort);
    }

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        if let Some(axis) = self.steps.get_mut(axis) {
            axis.order(steps);
        }
    }

    fn steps(&self, axis: usize) -> i32 {
        self.steps.get(axis).map_or(0, StepPulses::count)
    }

    fn encoder(&self, axis: usize) -> i32 {
        match &self.latched {
            Some(counts) => counts.get(axis).copied().unwrap_or(0),
            None => self.encoders.get(axis).map_or(0, Encoder::count),
        }
    }

    fn home_switch(&self, axis: usize) -> bool {
        self.home_switches.get(axis).is_some_and(Input::is_low)
    }

    fn hard_limit(&self, axis: usize) -> bool {
        self.hard_limits.get(axis).is_some_and(Input::is_high)
    }

    fn emergency_stop(&self) -> bool {
        self.emergency_stop.is_high()
    }

    fn fire_trigger(&mut self, at: Microseconds) {
        self.trigger.fire(at);
        self.trigger.poll();
    }

    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        self.trigger.take_edge()
    }
}
