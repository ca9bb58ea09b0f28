//! One axis under observation: its true mechanics, and what the board can know from its encoder.

use std::collections::VecDeque;

use vergence_control::RigIo;
use vergence_plant::{Plant, Stage};
use vergence_protocol::Counts;

use crate::faults::Fault;
use crate::promise::EncoderReading;

/// The control tick, which is also the period at which the truth is checked.
const TICK_S: f64 = 1e-3;
/// Time within which a lasting contact is distinguished from a spike; a spike shortly before may pass for its edge.
const DEBOUNCE_S: f64 = 10e-3;
/// Ticks for which the position of the load is remembered.
const RECENT_TICKS: usize = 16;
/// Tolerance of a speed as a share; steps that rounding moves from one tick to the next are added.
const SPEED_SHARE: f64 = 1.01;

#[derive(Debug)]
pub struct WatchedAxis {
    pub stage: Stage,
    pub reading: EncoderReading,
    /// Whether the encoder has ever failed.
    pub misread: bool,
    /// Largest error of the reference.
    pub reference_error: f64,
    pub steps: i32,
    pub load: f64,
    /// Positions of the load in the latest ticks, the oldest first.
    recent: VecDeque<f64>,
    /// Whether the encoder's reading or the reference may be wrong from the start.
    pub doubtful: bool,
    /// Whether the hard limit is dead.
    limit_is_dead: bool,
    /// Position of the load when its encoder was lost with the drivers on.
    pub lost_at: Option<f64>,
}

impl WatchedAxis {
    pub fn new(index: usize, stage: Stage, faults: &[Fault], plant: &Plant) -> Self {
        // The reference is the switch's edge, observed at a tick.
        let chatter = faults.iter().find_map(|fault| match *fault {
            Fault::SwitchBounce { axis, chatter_us, .. } if axis == index => {
                Some(chatter_us as f64 * 1e-6 + DEBOUNCE_S)
            }
            _ => None,
        });
        let late = TICK_S + chatter.unwrap_or(0.0);
        Self {
            stage,
            reading: EncoderReading::Clear,
            misread: false,
            reference_error: f64::from(stage.settings.homing.approach_speed) * late,
            steps: plant.steps(index),
            load: plant.load(index).unwrap_or_default(),
            recent: VecDeque::new(),
            doubtful: faults.contains(&Fault::CrossedSwitches),
            limit_is_dead: faults.contains(&Fault::DeadLimit(index)),
            lost_at: None,
        }
    }

    /// Takes the position of the load in this tick.
    pub fn observe(&mut self, load: f64) {
        self.load = load;
        self.recent.push_back(load);
        if self.recent.len() > RECENT_TICKS {
            self.recent.pop_front();
        }
    }

    /// The distance that no controller can avoid: that of a tick at full speed, and the load's lag behind its motor.
    pub fn overshoot(&self) -> f64 {
        let mechanics = &self.stage.mechanics;
        f64::from(self.stage.settings.speed) * (TICK_S + mechanics.compliance) + mechanics.backlash
    }

    /// Checks that the load is inside its hard limits; where these are dead, a board that is right about its position knows
    /// of them by its range alone.
    pub fn check_hard_limit(&self, referenced: bool) -> Option<String> {
        if self.limit_is_dead && !(referenced && self.is_clear()) {
            return None;
        }
        let [low, high] = self.stage.mechanics.hard_limits;
        let beyond = (low - self.load).max(self.load - high);
        // One wrong reading is no limit, so that a second tick may pass.
        let allowed = self.overshoot() + f64::from(self.stage.settings.speed) * TICK_S;
        (beyond > allowed).then(|| format!("{beyond:.1} beyond its hard limit, at {:.1}", self.load))
    }

    /// Whether encoder and reference have always been right.
    fn is_clear(&self) -> bool {
        !self.misread && !self.doubtful
    }

    /// Checks the steps `made` in a tick against a limit of the speed, in micro-units per second.
    pub fn check_speed(&self, made: i32, limit: u32) -> Option<String> {
        let allowed = f64::from(limit) * TICK_S * SPEED_SHARE / self.stage.micro_per_step() + 2.0;
        let speed = f64::from(made.abs());
        (speed > allowed).then(|| format!("{speed} steps of {allowed:.1} in a tick"))
    }

    /// Checks the range of an axis with a reference: outside, up to `max` of the settings in force, it goes no further.
    pub fn check_range(&self, max: i32) -> Option<String> {
        let before = *self.recent.iter().rev().nth(1)?;
        let settings = &self.stage.settings;
        let beyond = |load: f64| (f64::from(settings.min.0) - load).max(load - f64::from(max));
        let allowed = f64::from(settings.following_error.0) + self.overshoot();
        let goes_on = self.is_clear() && beyond(self.load) > allowed && beyond(self.load) > beyond(before) + 1.0;
        goes_on.then(|| format!("goes on {:.1} of {allowed:.1} outside its range", beyond(self.load)))
    }

    /// Checks counts that the board reports with a reference and that are `ticks` old at most.
    pub fn check_pose(&self, counts: Counts, ticks: usize) -> Option<String> {
        let within = self.recent.iter().rev().take(ticks + 1);
        let (low, high) = within.fold((self.load, self.load), |(low, high), &load| (low.min(load), high.max(load)));
        self.check_counts(counts, [low, high])
    }

    /// Checks counts that the board reports with a reference: the load was between these two positions.
    pub fn check_counts(&self, counts: Counts, [low, high]: [f64; 2]) -> Option<String> {
        if !self.is_clear() {
            return None;
        }
        let allowed = self.reference_error + 2.0 * self.stage.micro_per_count();
        let said = f64::from(self.stage.settings.encoder().position_at(counts.0).0);
        let off = (low - said).max(said - high);
        (off > allowed).then(|| format!("reported {off:.1} of {allowed:.1} beside its load"))
    }

    pub fn check_following(&self) -> Option<String> {
        let settings = &self.stage.settings;
        let allowed = f64::from(settings.following_error.0 + settings.homing.repeatability.0) + self.overshoot();
        let way = (self.load - self.lost_at?).abs();
        (way > allowed).then(|| format!("went {way:.1} of {allowed:.1} without encoder"))
    }

    pub fn mode_tolerance(&self) -> f64 {
        let settings = &self.stage.settings;
        let blind = if self.misread { f64::from(settings.following_error.0) } else { 0.0 };
        f64::from(settings.tolerance.0) + self.reference_error + 2.0 * self.stage.micro_per_count() + blind
    }
}
