//! How far the two boards may be apart, and why: `hil-sim/FIDELITY.md` lists the reasons.

use vergence_control::{AxisSettings, TICK_US};
use vergence_plant::Stage;
use vergence_protocol::{AxisMask, ControllerState, Counts};

use super::pair::Snapshot;
use crate::stages::stages;

/// Steps are 20 us late on the chip, its mechanics advance each 20 us, and the edges of its encoders are spread over the next
/// 20 us: in motion it shows where it was this long ago, in ticks.
const LAG_TICKS: f64 = 0.07;
/// Rounding of either encoder, in counts.
const ROUNDING: f64 = 2.0;
/// Ticks by which homing may be apart on both boards, where one sees a switch a tick earlier than the other: the fast search goes
/// as far in a tick as the slow approach in 20 (baseline) and 10 (separation), and the second axis follows the first.
pub const HOMING_TICKS: u64 = 34;
/// Ticks by which a motion may end apart that an encoder, a switch or a request ends at once.
const CUT_TICKS: f64 = 2.0;
/// The largest speed of the latest ticks counts: messages come some ticks after what they tell.
const FADES: f64 = 0.97;

/// The places that the two boards take for the same, in micro-units of each axis.
#[derive(Clone, Debug)]
pub struct Slack {
    stages: [Stage; 2],
    /// Lasting difference of the references.
    pub places: [f64; 2],
    /// Since the last rest: that the motors may have made more steps on one board.
    pub motors: [f64; 2],
    /// Largest speed of each axis lately, in micro-units for each tick.
    speeds: [f64; 2],
    /// Since the last rest: whether an axis was homed; and the axes that have a reference now.
    has_homed: bool,
    referenced: AxisMask,
}

impl Slack {
    /// No slack: both boards count from where they got power.
    pub fn new() -> Self {
        Self {
            stages: stages(),
            places: [0.0; 2],
            motors: [0.0; 2],
            speeds: [0.0; 2],
            has_homed: false,
            referenced: AxisMask::default(),
        }
    }

    fn settings(&self, axis: usize) -> &AxisSettings {
        &self.stages[axis].settings
    }

    /// Micro-units for each motor step.
    pub fn step(&self, axis: usize) -> f64 {
        self.stages[axis].micro_per_step()
    }

    /// Micro-units for each count.
    fn count(&self, axis: usize) -> f64 {
        self.stages[axis].micro_per_count()
    }

    /// Takes the next tick of the native board.
    pub fn tick(&mut self, before: &Snapshot, now: &Snapshot) {
        self.has_homed |= now.pose.state == ControllerState::Homing;
        self.referenced = now.pose.referenced;
        for axis in 0..2 {
            let load = (now.loads[axis] - before.loads[axis]).abs();
            let motor = f64::from(now.steps[axis].wrapping_sub(before.steps[axis]).abs()) * self.step(axis);
            self.speeds[axis] = load.max(motor).max(self.speeds[axis] * FADES);
            if before.drivers_on && !now.drivers_on {
                self.places[axis] += CUT_TICKS * self.speeds[axis];
                self.motors[axis] += CUT_TICKS * self.speeds[axis];
            }
        }
    }

    /// The boards home an axis some ticks apart.
    pub fn homes_apart(&mut self, axis: usize) {
        let apart = HOMING_TICKS as f64 * per_tick(self.settings(axis).homing.seek_speed);
        self.places[axis] = self.places[axis].max(apart);
        self.motors[axis] = self.motors[axis].max(apart);
    }

    /// The boards have restarted: both count from where the loads stand, which may be apart.
    pub fn restarted(&mut self) {
        self.speeds = [0.0; 2];
    }

    /// The motors have come to rest and were compared. A switch was seen within a tick of the slow approach.
    pub fn rested(&mut self) {
        let homed = if std::mem::take(&mut self.has_homed) { self.referenced } else { AxisMask::default() };
        for axis in (0..2).filter(|&axis| homed.contains(axis)) {
            self.places[axis] = per_tick(self.settings(axis).homing.approach_speed);
        }
        self.motors = self.places;
    }

    /// Largest difference of the loads of an axis at the same instant, in micro-units: a place may be rounded to another step,
    /// the boards may be `apart` ticks apart.
    pub fn load(&self, axis: usize, apart: f64) -> f64 {
        self.places[axis] + self.step(axis) + (LAG_TICKS + apart) * self.speeds[axis]
    }

    /// The time in which an axis goes so many counts at its latest speed, in ticks; `None` where it is slow.
    pub fn ticks_of(&self, axis: usize, counts: i32) -> Option<f64> {
        let speed = self.speeds[axis] / self.count(axis);
        (speed > 50.0).then(|| f64::from(counts) / speed)
    }

    /// The same of the counts.
    pub fn counts(&self, axis: usize, apart: f64) -> f64 {
        self.load(axis, apart) / self.count(axis) + ROUNDING
    }

    /// Largest difference of the steps that the motors have made since the last rest.
    pub fn steps(&self, axis: usize) -> f64 {
        (self.motors[axis] + self.places[axis]) / self.step(axis) + 2.0
    }

    /// Steps by which targets are apart: by the references, and two that start and target are rounded to.
    pub fn target_steps(&self, axis: usize) -> f64 {
        if self.places[axis] > 0.0 { self.places[axis] / self.step(axis) + 2.0 } else { 0.0 }
    }
}

/// The distance of a tick at a speed in micro-units for each second.
fn per_tick(speed: u32) -> f64 {
    f64::from(speed) * TICK_US as f64 * 1e-6
}

/// The difference of two counts.
pub fn apart(native: Counts, chip: Counts) -> i32 {
    native.0.wrapping_sub(chip.0).wrapping_abs()
}
