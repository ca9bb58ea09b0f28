//! StallGuard4 of a TMC2209: the time of a step and the load of the motor (datasheet rev. 1.09, section 11).
//!
//! The load is a simplified linear model: SG_RESULT grows with the speed and falls with the share of its force that the
//! motor needs. Real values depend on motor, supply, current and temperature as well, and scatter.

use vergence_protocol::Microseconds;

/// What a motor did in a while.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Step pulses in this while.
    pub steps: u32,
    /// Times of the last two step pulses in nanoseconds, the later one first.
    pub last: [u64; 2],
    /// Share of its largest force that the motor needs against an obstacle, 0 to 1.
    pub pressed: f64,
}

/// Clocks of 12 MHz in a nanosecond.
const CLOCKS: f64 = 0.012;
/// TSTEP of a motor that stands.
const STANDS: u32 = (1 << 20) - 1;
/// SG_RESULT of a motor without load: at no speed, and more for each full step a second, up to the largest value.
const AT_REST: f64 = 80.0;
const PER_FULL_STEP: f64 = 0.05;
const LARGEST: f64 = 510.0;
/// Share of its force that a motor needs for friction alone, and share of SG_RESULT that a motor keeps which stands: its
/// rotor trembles.
const FRICTION: f64 = 0.25;
const TREMBLING: f64 = 0.15;

/// Measurement of one driver.
#[derive(Clone, Copy, Debug)]
pub struct StallGuard {
    tstep: u32,
    result: u32,
    /// Microsteps since the last whole full step.
    microsteps: u32,
}

impl Default for StallGuard {
    fn default() -> Self {
        Self { tstep: STANDS, result: 0, microsteps: 0 }
    }
}

impl StallGuard {
    /// Measures anew; a step pulse is one of `microsteps` of a full step.
    pub fn advance(&mut self, now: Microseconds, motor: Turning, microsteps: u32) {
        let [last, before] = motor.last;
        // A step that does not come makes the time longer.
        let time = last.saturating_sub(before).max((now.0 * 1000).saturating_sub(last)) as f64;
        let clocks = time * CLOCKS * f64::from(microsteps) / 256.0;
        self.tstep = (clocks as u32).min(STANDS);
        self.microsteps += motor.steps;
        // SG_RESULT is made anew with each full step.
        if self.microsteps >= microsteps {
            self.microsteps %= microsteps;
            let full_steps = 1e9 / (time.max(1.0) * f64::from(microsteps));
            let unloaded = (AT_REST + PER_FULL_STEP * full_steps).min(LARGEST);
            let load = (FRICTION + (1.0 - FRICTION) * motor.pressed).min(1.0 - TREMBLING);
            // Bits 0 and 9 are always 0.
            self.result = (unloaded * (1.0 - load)) as u32 & 0x1FE;
        }
    }

    /// TSTEP: time of 1/256 of a full step, in clocks of 12 MHz.
    pub fn tstep(&self) -> u32 {
        self.tstep
    }

    /// SG_RESULT.
    pub fn result(&self) -> u32 {
        self.result
    }
}
