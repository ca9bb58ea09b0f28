//! One axis under observation: its true mechanics, and what the board can know from its encoder.

use vergence_control::RigIo;
use vergence_plant::{Plant, Stage};

use crate::faults::Fault;
use crate::promise::EncoderReading;

/// The control tick, which is also the period at which the truth is checked.
const TICK_S: f64 = 1e-3;
/// Time within which a lasting contact is distinguished from a spike; a spike shortly before may pass for its edge.
const DEBOUNCE_S: f64 = 10e-3;
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
            lost_at: None,
        }
    }

    /// The distance that no controller can avoid: that of a tick at full speed, and the load's lag behind its motor.
    pub fn overshoot(&self) -> f64 {
        let mechanics = &self.stage.mechanics;
        f64::from(self.stage.settings.speed) * (TICK_S + mechanics.compliance) + mechanics.backlash
    }

    pub fn check_hard_limit(&self) -> Option<String> {
        let [low, high] = self.stage.mechanics.hard_limits;
        let beyond = (low - self.load).max(self.load - high);
        // One wrong reading is no limit, so that a second tick may pass.
        let allowed = self.overshoot() + f64::from(self.stage.settings.speed) * TICK_S;
        (beyond > allowed).then(|| format!("{beyond:.1} beyond its hard limit, at {:.1}", self.load))
    }

    /// The speed limit: homing speed without a reference, because obstacles are unknown then.
    pub fn check_gentle(&self, made: i32) -> Option<String> {
        let settings = &self.stage.settings;
        let step = f64::from(settings.motor().position_at(1_000_000).0) * 1e-6;
        let allowed = f64::from(settings.homing.seek_speed) * TICK_S * SPEED_SHARE / step + 2.0;
        let speed = f64::from(made.abs());
        (speed > allowed).then(|| format!("{speed} steps of {allowed:.1} in a tick without reference"))
    }

    pub fn check_following(&self) -> Option<String> {
        let settings = &self.stage.settings;
        let allowed = f64::from(settings.following_error.0 + settings.homing.repeatability.0) + self.overshoot();
        let way = (self.load - self.lost_at?).abs();
        (way > allowed).then(|| format!("went {way:.1} of {allowed:.1} without encoder"))
    }

    pub fn mode_tolerance(&self) -> f64 {
        let settings = &self.stage.settings;
        let count = f64::from(settings.encoder().position_at(1_000_000).0) * 1e-6;
        let blind = if self.misread { f64::from(settings.following_error.0) } else { 0.0 };
        f64::from(settings.tolerance.0) + self.reference_error + 2.0 * count + blind
    }
}
