//! The joints of Origaker's trunk as delivered: five servos XM430 with the ids of the robot's own software.
//!
//! A position is the interior angle of the joint, which the servo shows without offset or gear: half a turn where the joint is
//! straight. Ids and ranges are published with the robot; speeds, currents and tolerances are assumed for its trunk.

use vergence_protocol::{AxisKind, Micro};

use crate::driver::{DriverKind, DriverSettings};
use crate::encoder::{EncoderKind, EncoderSettings};
use crate::settings::{AxisSettings, HomingSettings};
use crate::switches::SwitchSettings;

/// Counts of a servo in one revolution.
const COUNTS: u32 = 4_096;

/// Settings of the front corner, the rear corner, the side joint between them, the rear fold and the front fold.
#[must_use]
pub fn joints() -> [AxisSettings; 5] {
    let corner = [20_000, 290_000];
    let side = [8_200, 270_000];
    let fold = [0, 240_000];
    let mut servo_id = 12;
    [corner, corner, side, fold, fold].map(|range| {
        servo_id += 1;
        joint(servo_id, range.map(|end| Micro(millidegrees(end))))
    })
}

/// A joint with servo number `servo_id`, within `range`.
#[must_use]
pub fn joint(servo_id: u32, range: [Micro; 2]) -> AxisSettings {
    let [min, max] = range;
    AxisSettings {
        kind: AxisKind::Rotary,
        min,
        max,
        speed: millidegrees(60_000).unsigned_abs(),
        acceleration: millidegrees(120_000).unsigned_abs(),
        jerk: millidegrees(1_200_000).unsigned_abs(),
        // A servo makes no steps; goals are as fine as its encoder.
        steps_per_unit: COUNTS,
        counts_per_unit: COUNTS,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(millidegrees(8_000)),
        // Five counts: friction keeps a servo so far from its goal.
        tolerance: Micro(millidegrees(440)),
        backlash: Micro(0),
        // Half a newton metre turns a servo by two degrees.
        correction: Micro(millidegrees(4_000)),
        // Not used: a servo knows its angle. They are such that a stage could have them.
        homing: HomingSettings {
            switch_at: Micro(min.0 - millidegrees(2_000)),
            seek_speed: millidegrees(20_000).unsigned_abs(),
            approach_speed: millidegrees(2_000).unsigned_abs(),
            retract: Micro(millidegrees(2_000)),
            travel: Micro(millidegrees(300_000)),
            repeatability: Micro(millidegrees(200)),
        },
        driver: DriverSettings {
            kind: DriverKind::Servo,
            run_ma: 1_600,
            hold_ma: 1_600,
            servo_id,
            ..DriverSettings::default()
        },
        switches: SwitchSettings::default(),
        feedback: EncoderSettings { kind: EncoderKind::Servo, index_every: 0, zero: 0 },
    }
}

/// Converts an angle from thousandths of a degree to the nearest microradian.
const fn millidegrees(angle: i32) -> i32 {
    ((angle as i64 * 174_532_925 + 5_000_000) / 10_000_000) as i32
}
