//! Default settings: the bench, with a linear stage for the baseline and a pinion stage for the separation.

use vergence_control::{AxisSettings, DriverSettings, EncoderSettings, HomingSettings, SwitchSettings};
use vergence_protocol::{AxisKind, Micro};

use crate::rig::AXES;
use crate::wiring;

/// Converts a positive angle from thousandths of a degree to the nearest microradian.
const fn millidegrees(angle: i32) -> i32 {
    ((angle as i64 * 174_532_925 + 5_000_000) / 10_000_000) as i32
}

/// Settings of all axes.
pub fn axes() -> [AxisSettings; AXES] {
    wiring::AXES.map(|kind| match kind {
        AxisKind::Linear => linear(),
        AxisKind::Rotary => rotary(),
    })
}

/// A linear stage: a screw of 2 mm pitch, a 200-step motor in 1/8 steps, 60 to 220 mm.
fn linear() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Linear,
        min: Micro(60_000),
        max: Micro(220_000),
        speed: 80_000,
        acceleration: 400_000,
        jerk: 8_000_000,
        steps_per_unit: 800_000,
        counts_per_unit: 2_000_000,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(1_000),
        tolerance: Micro(20),
        backlash: Micro(0),
        correction: Micro(0),
        homing: HomingSettings {
            switch_at: Micro(58_000),
            seek_speed: 40_000,
            approach_speed: 2_000,
            retract: Micro(3_000),
            travel: Micro(200_000),
            repeatability: Micro(200),
        },
        driver: DriverSettings::default(),
        switches: SwitchSettings::default(),
        feedback: EncoderSettings::default(),
    }
}

/// A pinion stage: 0 to 130 degrees, 64 000 steps per revolution.
fn rotary() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Rotary,
        min: Micro(0),
        max: Micro(millidegrees(130_000)),
        speed: millidegrees(60_000).unsigned_abs(),
        acceleration: millidegrees(240_000).unsigned_abs(),
        jerk: millidegrees(4_000_000).unsigned_abs(),
        steps_per_unit: 64_000,
        counts_per_unit: 100_000,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(millidegrees(1_000)),
        tolerance: Micro(millidegrees(20)),
        backlash: Micro(0),
        correction: Micro(0),
        homing: HomingSettings {
            switch_at: Micro(-millidegrees(1_500)),
            seek_speed: millidegrees(20_000).unsigned_abs(),
            approach_speed: millidegrees(2_000).unsigned_abs(),
            retract: Micro(millidegrees(2_000)),
            travel: Micro(millidegrees(160_000)),
            repeatability: Micro(millidegrees(100)),
        },
        driver: DriverSettings::default(),
        switches: SwitchSettings::default(),
        feedback: EncoderSettings::default(),
    }
}
