//! How far the two boards may be apart, and why: `hil-sim/FIDELITY.md` lists the reasons.

use std::collections::VecDeque;

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
/// Largest following errors of each axis, in micro-units, that the lag and the play of a sound load reach.
pub const LAG_LIMITS: [i64; 2] = [50, 1_000];
/// Ticks by which both boards may find such a limit exceeded: the lag grows by less than a count in a tick.
pub const LAG_LIMIT_TICKS: u64 = 12;
/// Ticks by which a motion may end apart that an encoder, a switch or a request ends at once.
const CUT_TICKS: f64 = 2.0;
/// Counts by which places may be apart that both boards give the same reference: one for the count at which the switch closed,
/// one for the count at which the command is taken up.
const REFERENCE_COUNTS: f64 = 2.0;
/// Share of its way that an axis makes at the edge between a stall and a slip, to either side.
const EDGE_SHARE: f64 = 0.25;
/// The way over which the controller tells them apart is at least this share of the largest following error, and at most
/// twice as long and a tick.
const BLAMED_SHARE: f64 = 0.125;
/// Ticks by which the message of a fault may come after it.
const MESSAGE_TICKS: usize = 8;
/// Ticks that are kept for that.
const KEPT: usize = 64;
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
    /// The way of motor and load in each of the latest ticks, in micro-units.
    ways: [VecDeque<[f64; 2]>; 2],
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
            ways: [VecDeque::new(), VecDeque::new()],
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
            self.note_way(axis, before, now);
            if before.drivers_on && !now.drivers_on {
                self.places[axis] += CUT_TICKS * self.speeds[axis];
                self.motors[axis] += CUT_TICKS * self.speeds[axis];
            }
        }
    }

    fn note_way(&mut self, axis: usize, before: &Snapshot, now: &Snapshot) {
        let motor = f64::from(now.steps[axis].wrapping_sub(before.steps[axis])) * self.step(axis);
        let ways = &mut self.ways[axis];
        ways.push_back([motor, now.loads[axis] - before.loads[axis]]);
        if ways.len() > KEPT {
            ways.pop_front();
        }
    }

    /// Whether the load of an axis has lately made a quarter of its motor's way, as far as an encoder can tell: one board may
    /// call this a stall and the other a slip (or a stall and a wrong direction, where it went back).
    pub fn is_between_stall_and_slip(&self, axis: usize) -> bool {
        let least = BLAMED_SHARE * f64::from(self.settings(axis).following_error.0);
        let unsure = 2.0 * self.count(axis) + (LAG_TICKS + 1.0) * self.speeds[axis] * EDGE_SHARE;
        let ways = &self.ways[axis];
        // A fault is told within some ticks: the way that was judged may have ended then.
        (0..CUT_TICKS as usize + MESSAGE_TICKS).any(|ended| {
            let mut sum = [0.0; 2];
            ways.iter().rev().skip(ended).any(|way| {
                sum = [sum[0] + way[0], sum[1] + way[1]];
                let [motor, load] = [sum[0].abs(), sum[1] * sum[0].signum()];
                let judged = (least..=2.0 * least + self.speeds[axis]).contains(&motor);
                judged && (load.abs() - EDGE_SHARE * motor).abs() <= unsure
            })
        })
    }

    /// How far references may be apart: the switch is seen within a tick of the slow approach.
    fn reference(&self, axis: usize) -> f64 {
        per_tick(self.settings(axis).homing.approach_speed) + REFERENCE_COUNTS * self.count(axis)
    }

    /// How far the boards may be apart on the way back from the home switch and after it: the count at which the switch closed in
    /// the fast search lags, and the reference follows.
    fn way_back(&self, axis: usize) -> f64 {
        LAG_TICKS * per_tick(self.settings(axis).homing.seek_speed) + self.reference(axis)
    }

    /// The same in steps, one of them for the rounding of start and target.
    pub fn steps_back(&self, axis: usize) -> f64 {
        self.way_back(axis) / self.step(axis) + 1.0
    }

    /// Counts by which a search may end apart although its steps do not show it: where the axes are some steps apart before, as
    /// after drivers that went off in mid-move, steps are allowed as much, and the switch may be seen a tick earlier or later.
    pub fn search_counts(&self, axis: usize) -> f64 {
        let unseen = self.places[axis] > self.way_back(axis);
        if unseen { per_tick(self.settings(axis).homing.seek_speed) / self.count(axis) } else { 0.0 }
    }

    /// An axis goes back from its home switch.
    pub fn goes_back(&mut self, axis: usize) {
        let way = self.way_back(axis);
        self.places[axis] = self.places[axis].max(way);
        self.motors[axis] = self.motors[axis].max(way);
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
            self.places[axis] = self.reference(axis);
        }
        self.motors = self.places;
    }

    /// Largest difference of the loads of an axis at the same instant, in micro-units: a place may be rounded to another step,
    /// the boards may be `apart` ticks apart.
    pub fn load(&self, axis: usize, apart: f64) -> f64 {
        self.load_at(axis, apart, self.speeds[axis])
    }

    /// The same at this speed, in micro-units for each tick.
    fn load_at(&self, axis: usize, apart: f64, speed: f64) -> f64 {
        self.places[axis] + self.step(axis) + (LAG_TICKS + apart) * speed
    }

    /// The same of the counts, around a tick in which the load went so far.
    pub fn counts_at(&self, axis: usize, apart: f64, speed: f64) -> f64 {
        self.load_at(axis, apart, speed.max(self.speeds[axis])) / self.count(axis) + ROUNDING
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
