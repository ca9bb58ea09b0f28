//! Bounds of axis settings beyond which the board could not keep its promises: to notice a stage that does not follow, to
//! call a move settled only where it is, and to stop in a stated time.
//!
//! Each bound is in proportion to the axis: a share of its whole travel, which is the way that homing may go, a mark of its
//! encoder, or another of its settings. The range is no measure: a host may narrow it for a while.

use vergence_protocol::{AxisKind, SettingItem};

use crate::driver::{ADDRESSES, DriverKind, DriverSettings, LEAST_FULL_STEPS};
use crate::encoder::{ABSOLUTE_AXES, EncoderKind};
use crate::settings::{AxisSettings, Scale, SettingsError};

/// Longest time to brake from full speed, in milliseconds.
pub const LONGEST_BRAKING_MS: u32 = 2_000;
/// Acceleration rises to its largest value in two control ticks or more: at most this share of it in a second.
const FASTEST_RISE: i64 = 500;
/// Longest travel of an axis: two metres or two turns.
const LONGEST_TRAVEL: [i64; 2] = [2_000_000, 12_566_371];

/// Smallest and largest current limit of a servo of the X series, in milliamperes: 1193 units of 2.69 mA.
const SERVO_MA: [u32; 2] = [100, 3_209];

/// The values that a setting may have beside the others.
struct Bound {
    item: SettingItem,
    value: i64,
    least: i64,
    most: i64,
    why: &'static str,
}

/// Checks the settings of axis number `axis`, whose range is not empty, and whose rates and distances are positive.
///
/// # Errors
/// [`SettingsError::Outside`] with the first setting out of its bounds, or [`SettingsError::Braking`].
pub(crate) fn check(settings: &AxisSettings, axis: usize) -> Result<(), SettingsError> {
    within(axis, &bounds(settings))?;
    within(axis, &driver_bounds(&settings.driver, axis))?;
    within(axis, &stall_bounds(settings))?;
    within(axis, &encoder_bounds(settings, axis))?;
    let milliseconds = braking_ms(settings);
    if milliseconds > LONGEST_BRAKING_MS {
        return Err(SettingsError::Braking { axis, milliseconds });
    }
    Ok(())
}

// Not inlined: three copies of it would take a kilobyte of flash.
#[inline(never)]
fn within(axis: usize, bounds: &[Bound]) -> Result<(), SettingsError> {
    match bounds.iter().find(|bound| !(bound.least..=bound.most).contains(&bound.value)) {
        Some(&Bound { item, least, most, why, .. }) => Err(SettingsError::Outside { axis, item, least, most, why }),
        None => Ok(()),
    }
}

fn bounds(settings: &AxisSettings) -> [Bound; 10] {
    let homing = &settings.homing;
    let [min, max] = [settings.min, settings.max].map(|end| i64::from(end.0));
    let travel = i64::from(homing.travel.0);
    let [slides, turns] = LONGEST_TRAVEL;
    let longest = if settings.kind == AxisKind::Linear { slides } else { turns };
    let reached = settings.encoder().position_at(1).0.max(settings.motor().position_at(1).0 / 2);
    let furthest = min.abs().max(max.abs()) + travel.max(1);
    let finest = |scale: Scale| i64::from(i32::MAX / 2) * (scale.milli_micro() / 1000) / furthest;
    let bound = |item, value: i64, least: i64, most: i64, why| Bound { item, value, least, most, why };
    [
        bound(
            SettingItem::FollowingError,
            settings.following_error.0.into(),
            1,
            travel / 25,
            "a stage that does not follow would go unnoticed",
        ),
        bound(
            SettingItem::Tolerance,
            settings.tolerance.0.into(),
            reached.max(1).into(),
            travel / 250,
            "below, encoder and motor cannot reach it; above, a move would count as settled where it is not",
        ),
        bound(
            SettingItem::Backlash,
            settings.backlash.0.into(),
            0,
            travel / 20,
            "it is the play of a stage, not a way",
        ),
        bound(
            SettingItem::Correction,
            settings.correction.0.into(),
            0,
            i64::from(settings.following_error.0) / 2,
            "a stage that is further off did not follow",
        ),
        bound(
            SettingItem::Jerk,
            settings.jerk.into(),
            1,
            i64::from(settings.acceleration) * FASTEST_RISE,
            "acceleration must take two control ticks to rise",
        ),
        bound(SettingItem::HomeRetract, homing.retract.0.into(), 1, travel / 10, "it leads away from the switch"),
        bound(SettingItem::HomeTravel, travel, 1, longest, "a search that misses the switch must end"),
        bound(
            SettingItem::HomeRepeatability,
            homing.repeatability.0.into(),
            1,
            travel / 100,
            "a bad reference would go unnoticed",
        ),
        bound(
            SettingItem::StepsPerUnit,
            settings.steps_per_unit.into(),
            1,
            finest(settings.motor()),
            "all steps from end to end, and as many again, must fit in 31 bits",
        ),
        bound(
            SettingItem::CountsPerUnit,
            settings.counts_per_unit.into(),
            1,
            finest(settings.encoder()),
            "all counts from end to end, and as many again, must fit in 31 bits",
        ),
    ]
}

/// Bounds of homing by StallGuard and of its watch (datasheet of the TMC2209, rev. 1.09, sections 11 and 15.4).
fn stall_bounds(settings: &AxisSettings) -> [Bound; 5] {
    let AxisSettings { driver, homing, switches, .. } = settings;
    let is_used = switches.stall_guard();
    let can_be_used = driver.kind == DriverKind::Tmc2209 && driver.stealth_chop;
    // Way of so many full steps. The speed is that at which StallGuard works, by three quarters of homing.
    let full_steps =
        |count: u64| i64::from(settings.motor().position_at((count * u64::from(driver.microsteps)) as i32).0);
    let [slowest, shortest] = if is_used { [LEAST_FULL_STEPS * 4 / 3 + 1, 16].map(full_steps) } else { [0; 2] };
    let bound = |item, value: i64, least: i64, most: i64, why| Bound { item, value, least, most, why };
    [
        bound(
            SettingItem::HomeSwitch,
            switches.home as i64,
            0,
            if can_be_used { 2 } else { 1 },
            "StallGuard needs driver = tmc2209 and stealth_chop = true",
        ),
        bound(
            SettingItem::StallThreshold,
            switches.stall_threshold.into(),
            is_used.into(),
            255,
            "with 0 the driver never reports a stall",
        ),
        bound(
            SettingItem::StallWatch,
            switches.stall_watch.into(),
            0,
            is_used.into(),
            "the board reads DIAG only where home_switch = stallguard",
        ),
        bound(
            SettingItem::HomeSeekSpeed,
            homing.seek_speed.min(settings.speed).into(),
            slowest,
            settings.speed.into(),
            "slower than 267 full steps a second StallGuard does not work",
        ),
        bound(
            SettingItem::FollowingError,
            settings.following_error.0.into(),
            shortest,
            i64::from(homing.travel.0) / 25,
            "the motor must press for eight full steps until it is known to stall",
        ),
    ]
}

/// Bounds of the settings of a motor driver, also of those that a plain driver does not use: then they hold when its kind
/// is changed.
fn driver_bounds(driver: &DriverSettings, axis: usize) -> [Bound; 6] {
    let is_joint = driver.kind == DriverKind::Servo;
    let [least, most] = if is_joint { SERVO_MA } else { driver.currents() }.map(i64::from);
    let run = i64::from(driver.run_ma);
    let kind = driver.kind as u32;
    let kinds = if is_joint { [kind.into(); 2] } else { [0, (axis < ADDRESSES).into()] };
    let bound = |item, value: u32, least: i64, most: i64, why| Bound { item, value: value.into(), least, most, why };
    [
        bound(SettingItem::Driver, kind, kinds[0], kinds[1], "the drivers' line has four addresses"),
        bound(SettingItem::SenseResistor, driver.sense_mohm, 50, 1_000, "with others the driver measures no current"),
        bound(
            SettingItem::RunCurrent,
            driver.run_ma,
            least,
            most,
            "the driver cannot regulate another current by its sense resistors",
        ),
        bound(
            SettingItem::HoldCurrent,
            driver.hold_ma,
            run / 8,
            run,
            "the current at rest is a share of that in motion",
        ),
        bound(SettingItem::HoldDelay, driver.hold_delay_us, 50_000, 5_500_000, "the driver can count no other time"),
        bound(SettingItem::ServoId, driver.servo_id, 0, 252, "a servo has no other number"),
    ]
}

/// Bounds of the settings of an encoder.
fn encoder_bounds(settings: &AxisSettings, axis: usize) -> [Bound; 3] {
    let encoder = &settings.feedback;
    let [min, max] = [settings.min, settings.max].map(|end| i64::from(settings.encoder().counts_at(end)));
    // At full speed a pulse may come in each second tick: the board keeps one for a tick.
    let least = (4 * i64::from(settings.largest_drift())).max(i64::from(settings.count_rate() / 500));
    let (least, most) = match encoder.index_every {
        0 => (0, 0),
        _ if encoder.is_absolute() => (0, 0),
        _ => (least, max - min),
    };
    // A sixteenth of the turn is left for the ways to the hard limits, so that no two places read the same.
    let turn = i64::from(encoder.turn());
    let fits = (axis < ABSOLUTE_AXES || settings.is_joint()) && max - min <= turn - turn / 16;
    let kinds = match (settings.is_joint(), fits) {
        (false, fits) => [0, fits.into()],
        (true, true) => [EncoderKind::Servo as i64; 2],
        // None.
        (true, false) => [1, 0],
    };
    let bound = |item, value: u32, least: i64, most: i64, why| Bound { item, value: value.into(), least, most, why };
    [
        bound(
            SettingItem::IndexEvery,
            encoder.index_every,
            least,
            most,
            "pulses must come within the range and two ticks apart; an absolute encoder has none",
        ),
        bound(
            SettingItem::Encoder,
            encoder.kind as u32,
            kinds[0],
            kinds[1],
            "the range must lie within 15/16 of a turn of an absolute encoder, on axis 0 or 1; a joint has that of its servo",
        ),
        bound(SettingItem::EncoderZero, encoder.zero, 0, turn - 1, "the encoder reads no more in a turn"),
    ]
}

/// Time to come to rest from full speed, in milliseconds: v/a + a/j, or 2 √(v/j) where full acceleration is not reached.
fn braking_ms(settings: &AxisSettings) -> u32 {
    let [speed, acceleration, jerk] = [settings.speed, settings.acceleration, settings.jerk].map(|rate| rate as f32);
    let seconds = if acceleration * acceleration <= speed * jerk {
        speed / acceleration + acceleration / jerk
    } else {
        2.0 * libm::sqrtf(speed / jerk)
    };
    (seconds * 1e3) as u32
}
