//! The mechanics, with the interface of the controller.

use embassy_stm32::gpio::{Input, Output};
use embassy_time::Instant;
use vergence_control::{DriverSettings, RigIo, StepSchedule, TriggerEdge};
use vergence_protocol::{AxisList, DriverState, Microseconds};

use crate::drivers;
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
    /// Asks the drivers for their holding current: high.
    pub holding: Output<'static>,
    /// Camera trigger.
    pub trigger: Trigger,
    /// The encoders as the running tick found them; `None` outside ticks.
    pub latched: Option<Latched>,
}

/// Counts of all encoders at one instant.
#[derive(Clone, Copy)]
pub struct Latched {
    at: Microseconds,
    counts: [i32; AXES],
}

impl Rig {
    /// Reads the encoders and the clock: the tick that begins works with these. Its own work takes up to 0.4 ms, in which an
    /// axis moves on by 32 um.
    pub fn latch_encoders(&mut self) {
        self.latched = Some(critical_section::with(|_| Latched {
            counts: self.encoders.each_ref().map(Encoder::count),
            at: Microseconds(Instant::now().as_micros()),
        }));
    }

    /// Ends the tick: from now on encoders are read when they are asked for.
    pub fn release_encoders(&mut self) {
        self.latched = None;
    }

    /// Starts the steps ordered for the tick that has begun. Returns whether the steps of the tick before were made in time.
    pub fn begin_tick(&mut self) -> bool {
        let mut in_time = true;
        let mut waits = self.steps.each_ref().map(|_| true);
        // No axis waits for the last pulse of another: its first step may be due before.
        while waits.contains(&true) {
            for (axis, waits) in self.steps.iter_mut().zip(&mut waits) {
                if *waits && axis.is_ready() {
                    *waits = false;
                    in_time &= axis.begin_tick();
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
        self.steps.iter_mut().for_each(StepPulses::abort);
        drivers::set_motors(on);
    }

    fn set_holding(&mut self, holding: bool) {
        self.holding.set_level(holding.into());
    }

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        if let Some(axis) = self.steps.get_mut(axis) {
            axis.order(steps);
        }
    }

    fn steps(&self, axis: usize) -> i32 {
        self.steps.get(axis).map_or(0, StepPulses::count)
    }

    // Not inlined: copies of it in the controller would take 5 kB of flash.
    #[inline(never)]
    fn encoder(&self, axis: usize) -> i32 {
        match &self.latched {
            Some(latched) => latched.counts.get(axis).copied().unwrap_or(0),
            None => self.encoders.get(axis).map_or(0, Encoder::count),
        }
    }

    fn expect_counts(&mut self, axis: usize, per_second: u32) {
        if let Some(encoder) = self.encoders.get_mut(axis) {
            encoder.expect(per_second);
        }
    }

    fn encoders_read_at(&self, now: Microseconds) -> Microseconds {
        self.latched.map_or(now, |latched| latched.at)
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

    fn configure_drivers(&mut self, settings: &AxisList<DriverSettings>) {
        drivers::configure(settings);
    }

    fn driver(&self, axis: usize) -> DriverState {
        drivers::state(axis)
    }

    fn fire_trigger(&mut self, at: Microseconds) {
        self.trigger.fire(at);
        self.trigger.poll();
    }

    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        self.trigger.take_edge()
    }
}
