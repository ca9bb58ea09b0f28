//! The bench: a linear stage for the baseline and a pinion stage for the separation.

use std::f64::consts::PI;

use vergence_control::{AxisSettings, HomingSettings};
use vergence_protocol::{AxisKind, Micro};

use crate::axis::AxisMechanics;

/// The bench's controller settings: baseline 60..220 mm, separation 0..130°.
///
/// The separation axis counts the angle between the two optical axes; each camera turns by half of it.
#[must_use]
pub fn bench_settings() -> [AxisSettings; 2] {
    [baseline(), separation()]
}

/// The mechanics that fit [`bench_settings`].
#[must_use]
pub fn bench_mechanics() -> [AxisMechanics; 2] {
    let [baseline, separation] = bench_settings();
    [
        AxisMechanics {
            backlash: 8.0,
            compliance: 2e-3,
            hard_limits: [52_000.0, 226_000.0],
            end_stops: [50_000.0, 228_000.0],
            ..fitting(&baseline)
        },
        AxisMechanics {
            backlash: 120.0,
            compliance: 2e-3,
            hard_limits: [-5.0 * PI / 180.0 * 1e6, 135.0 * PI / 180.0 * 1e6],
            end_stops: [-6.0 * PI / 180.0 * 1e6, 136.0 * PI / 180.0 * 1e6],
            ..fitting(&separation)
        },
    ]
}

/// Scales and home switch as the controller believes them to be, nothing else filled in.
fn fitting(settings: &AxisSettings) -> AxisMechanics {
    AxisMechanics {
        motor: settings.motor(),
        encoder: settings.encoder(),
        home_switch: f64::from(settings.homing.switch_at.0),
        backlash: 0.0,
        compliance: 1e-3,
        hard_limits: [f64::NEG_INFINITY, f64::INFINITY],
        end_stops: [f64::NEG_INFINITY, f64::INFINITY],
    }
}

/// A 2 mm screw driven by a 200-step motor in 1/16 steps; a linear encoder of 0.5 µm.
fn baseline() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Linear,
        min: Micro(60_000),
        max: Micro(220_000),
        speed: 80_000,
        acceleration: 400_000,
        jerk: 8_000_000,
        steps_per_unit: 1_600_000,
        counts_per_unit: 2_000_000,
        following_error: Micro(1_000),
        tolerance: Micro(20),
        homing: HomingSettings {
            switch_at: Micro(58_000),
            seek_speed: 40_000,
            approach_speed: 2_000,
            retract: Micro(3_000),
            travel: Micro(200_000),
            repeatability: Micro(200),
        },
    }
}

/// Two pinions on one rack; 100 000 counts and 64 000 steps for each revolution of the separation.
fn separation() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Rotary,
        min: Micro(0),
        max: Micro(degrees(130.0)),
        speed: degrees(60.0).unsigned_abs(),
        acceleration: degrees(240.0).unsigned_abs(),
        jerk: degrees(4_000.0).unsigned_abs(),
        steps_per_unit: 64_000,
        counts_per_unit: 100_000,
        following_error: Micro(degrees(1.0)),
        tolerance: Micro(degrees(0.02)),
        homing: HomingSettings {
            switch_at: Micro(degrees(-1.5)),
            // A search stopped while it speeds up needs 2.5° more, and the hard limit is 3.5° beyond the switch.
            seek_speed: degrees(20.0).unsigned_abs(),
            approach_speed: degrees(2.0).unsigned_abs(),
            retract: Micro(degrees(2.0)),
            travel: Micro(degrees(160.0)),
            repeatability: Micro(degrees(0.1)),
        },
    }
}

/// Degrees as whole microradians.
fn degrees(deg: f64) -> i32 {
    (deg * PI / 180.0 * 1e6).round() as i32
}
