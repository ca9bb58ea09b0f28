//! Stages of a bench for any range and encoder, and the bench itself: a linear stage for the baseline and a pinion
//! stage for the separation.

use std::f64::consts::PI;

use vergence_control::{AxisSettings, DriverSettings, EncoderSettings, HomingSettings, SwitchSettings};
use vergence_protocol::{AxisKind, Micro};

use crate::axis::{AxisMechanics, PitchError};
use crate::ends::{StopMechanics, SwitchMechanics};

/// A stage: the settings of its controller, and its real mechanics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// The settings of the controller.
    pub settings: AxisSettings,
    /// The mechanics.
    pub mechanics: AxisMechanics,
}

impl Stage {
    /// Length of a motor step in micro-units of the axis.
    #[must_use]
    pub fn micro_per_step(&self) -> f64 {
        f64::from(self.settings.motor().position_at(1_000_000).0) * 1e-6
    }

    /// Length of an encoder count in micro-units of the axis.
    #[must_use]
    pub fn micro_per_count(&self) -> f64 {
        f64::from(self.settings.encoder().position_at(1_000_000).0) * 1e-6
    }

    /// A 2 mm screw driven by a 200-step motor in 1/8 steps, with a linear encoder; home switch 2 mm below `min`.
    #[must_use]
    pub fn linear(min: Micro, max: Micro, counts_per_metre: u32) -> Self {
        let settings = AxisSettings {
            kind: AxisKind::Linear,
            min,
            max,
            speed: 80_000,
            acceleration: 400_000,
            jerk: 8_000_000,
            steps_per_unit: 800_000,
            counts_per_unit: counts_per_metre,
            steps_reversed: false,
            counts_reversed: false,
            following_error: Micro(1_000),
            tolerance: Micro(20),
            backlash: Micro(0),
            correction: Micro(0),
            homing: HomingSettings {
                switch_at: Micro(min.0 - 2_000),
                seek_speed: 40_000,
                approach_speed: 2_000,
                retract: Micro(3_000),
                travel: Micro(max.0 - min.0 + 40_000),
                repeatability: Micro(200),
            },
            driver: DriverSettings::default(),
            switches: SwitchSettings::default(),
            feedback: EncoderSettings::default(),
        };
        Self { settings, mechanics: mechanics(&settings, 8.0, [8_000.0, 6_000.0], 2_000.0) }
    }

    /// A pinion whose turn is the axis position; 64 000 steps for each revolution. Home switch 1.5° below `min`.
    #[must_use]
    pub fn rotary(min: Micro, max: Micro, counts_per_revolution: u32) -> Self {
        let settings = AxisSettings {
            kind: AxisKind::Rotary,
            min,
            max,
            speed: degrees(60.0).unsigned_abs(),
            acceleration: degrees(240.0).unsigned_abs(),
            jerk: degrees(4_000.0).unsigned_abs(),
            steps_per_unit: 64_000,
            counts_per_unit: counts_per_revolution,
            steps_reversed: false,
            counts_reversed: false,
            following_error: Micro(degrees(1.0)),
            tolerance: Micro(degrees(0.02)),
            backlash: Micro(0),
            correction: Micro(0),
            homing: HomingSettings {
                switch_at: Micro(min.0 - degrees(1.5)),
                // A search stopped while it speeds up needs 2.5° more, and the hard limit is 3.5° beyond the switch.
                seek_speed: degrees(20.0).unsigned_abs(),
                approach_speed: degrees(2.0).unsigned_abs(),
                retract: Micro(degrees(2.0)),
                travel: Micro(max.0 - min.0 + degrees(30.0)),
                repeatability: Micro(degrees(0.1)),
            },
            driver: DriverSettings::default(),
            switches: SwitchSettings::default(),
            feedback: EncoderSettings::default(),
        };
        let limit = f64::from(degrees(5.0));
        Self { settings, mechanics: mechanics(&settings, 120.0, [limit, limit], f64::from(degrees(1.0))) }
    }
}

/// Mechanics with the scales of the settings; the hard limits lie `beyond` the range, the end stops `further` out.
fn mechanics(settings: &AxisSettings, backlash: f64, beyond: [f64; 2], further: f64) -> AxisMechanics {
    let hard_limits = [f64::from(settings.min.0) - beyond[0], f64::from(settings.max.0) + beyond[1]];
    AxisMechanics {
        motor: settings.motor(),
        encoder: settings.encoder(),
        backlash,
        pitch: PitchError::default(),
        encoder_play: 0.0,
        scale: PitchError::default(),
        index: [0; 2],
        compliance: 2e-3,
        home_switch: f64::from(settings.homing.switch_at.0),
        switches: SwitchMechanics::default(),
        hard_limits,
        end_stops: [hard_limits[0] - further, hard_limits[1] + further],
        stop: StopMechanics::default(),
    }
}

/// Baseline 60..220 mm with a linear encoder of 0.5 µm; separation 0..130°, counted between the two optical axes (each
/// camera turns by half of it), with 100 000 counts for each revolution of the separation.
fn bench() -> [Stage; 2] {
    let baseline = Stage::linear(Micro(60_000), Micro(220_000), 2_000_000);
    [baseline, Stage::rotary(Micro(0), Micro(degrees(130.0)), 100_000)]
}

/// The bench's controller settings.
#[must_use]
pub fn bench_settings() -> [AxisSettings; 2] {
    bench().map(|stage| stage.settings)
}

/// The bench's mechanics.
#[must_use]
pub fn bench_mechanics() -> [AxisMechanics; 2] {
    bench().map(|stage| stage.mechanics)
}

/// Degrees as whole microradians.
fn degrees(deg: f64) -> i32 {
    (deg * PI / 180.0 * 1e6).round() as i32
}
