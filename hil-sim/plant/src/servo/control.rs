//! The loops that a servo's own firmware closes: profile, position, velocity, current, PWM.

use std::f64::consts::TAU;

use vergence_dynamixel::table;
use vergence_dynamixel::units::OperatingMode;

use super::motor::Drive;
use super::registers::Registers;

/// Radians of one count of the position.
pub(super) const COUNT: f64 = TAU / 4096.0;
/// Radians per second of one unit of the velocity.
pub(super) const VELOCITY: f64 = 0.229 * TAU / 60.0;
/// Radians per second² of one unit of the acceleration.
const ACCELERATION: f64 = 214.577 * TAU / 3600.0;
/// Amperes of one unit of the current.
pub(super) const CURRENT: f64 = 2.69e-3;
/// Full duty of the bridge, in units of the PWM.
const FULL_PWM: f64 = 885.0;
/// Seconds between two steps of the loops (assumed).
pub(super) const PERIOD: f64 = 1e-3;

/// What the loops remember.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Loops {
    /// Where the profile is, in counts, and its velocity in counts per second.
    pub profile: f64,
    pub profile_velocity: f64,
    integral: f64,
    last_error: f64,
    /// What the last step put on the bridge, in units of the PWM.
    pub pwm: f64,
    /// Whether the goal stands still because the watchdog has bitten.
    pub halted: bool,
}

/// What the encoder shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shown {
    /// Counts.
    pub position: f64,
    /// Radians per second.
    pub velocity: f64,
}

impl Loops {
    /// Begins anew where the servo stands, as when torque goes on.
    pub fn start(&mut self, at: f64) {
        *self = Self { profile: at, ..Self::default() };
    }

    /// One period: the voltage of the bridge.
    pub fn step(&mut self, registers: &Registers, shown: Shown, supply: f64) -> Drive {
        let value = |register| registers.get(register) as f64;
        let mode = u8::try_from(registers.get(&table::OPERATING_MODE)).ok().and_then(OperatingMode::of_register);
        let mode = mode.unwrap_or(OperatingMode::Position);
        let current_goal = value(&table::GOAL_CURRENT) * CURRENT;
        let most = value(&table::GOAL_PWM).abs().min(FULL_PWM);
        let (pwm, limit) = match mode {
            OperatingMode::Position | OperatingMode::ExtendedPosition => {
                (self.position(registers, shown, most), f64::MAX)
            }
            OperatingMode::CurrentBasedPosition => (self.position(registers, shown, most), current_goal.abs()),
            OperatingMode::Velocity => (self.velocity(registers, shown, most), f64::MAX),
            OperatingMode::Current => {
                let current = if self.halted { 0.0 } else { current_goal };
                (FULL_PWM * current.signum(), current.abs())
            }
            OperatingMode::Pwm => (if self.halted { 0.0 } else { value(&table::GOAL_PWM) }, f64::MAX),
        };
        self.pwm = pwm;
        Drive::Voltage { volts: pwm / FULL_PWM * supply, limit }
    }

    /// The position loop: profile, PID and feed-forward (e-manual, "Position PID Gain": P by 128, I by 65536, D by 16; the error in
    /// counts, one step each millisecond).
    fn position(&mut self, registers: &Registers, shown: Shown, most: f64) -> f64 {
        let value = |register| registers.get(register) as f64;
        let before = self.profile_velocity;
        self.advance_profile(
            if self.halted { self.profile } else { value(&table::GOAL_POSITION) },
            value(&table::PROFILE_VELOCITY) * VELOCITY / COUNT,
            value(&table::PROFILE_ACCELERATION) * ACCELERATION / COUNT,
        );
        let error = self.profile - shown.position;
        let gain = |register, by: f64| value(register) / by;
        let slope = error - self.last_error;
        self.last_error = error;
        let forward = gain(&table::FEEDFORWARD_1ST_GAIN, 4.0) * self.profile_velocity * COUNT / VELOCITY
            + gain(&table::FEEDFORWARD_2ND_GAIN, 4.0) * (self.profile_velocity - before) / PERIOD * COUNT
                / ACCELERATION;
        let wanted = gain(&table::POSITION_P_GAIN, 128.0) * error
            + self.integral
            + gain(&table::POSITION_D_GAIN, 16.0) * slope
            + forward;
        // Against wind-up the integral rests while the bridge is at its end.
        if wanted.abs() < most {
            self.integral += gain(&table::POSITION_I_GAIN, 65_536.0) * error;
        }
        wanted.clamp(-most, most)
    }

    /// The velocity loop (e-manual, "Velocity PI Gain": P by 128, I by 65536; the error in units of the velocity).
    fn velocity(&mut self, registers: &Registers, shown: Shown, most: f64) -> f64 {
        let value = |register| registers.get(register) as f64;
        let goal = if self.halted { 0.0 } else { value(&table::GOAL_VELOCITY) };
        let error = goal - shown.velocity / VELOCITY;
        let wanted = value(&table::VELOCITY_P_GAIN) / 128.0 * error + self.integral;
        if wanted.abs() < most || wanted * error < 0.0 {
            self.integral += value(&table::VELOCITY_I_GAIN) / 65_536.0 * error;
        }
        wanted.clamp(-most, most)
    }

    /// Moves the profile towards `goal`, as a trapezoid of the velocity. A limit of 0 is none.
    fn advance_profile(&mut self, goal: f64, most: f64, acceleration: f64) {
        let left = goal - self.profile;
        if most == 0.0 {
            (self.profile, self.profile_velocity) = (goal, 0.0);
            return;
        }
        // The fastest that can still stop at the goal, in whole periods.
        let stopping = if acceleration == 0.0 {
            f64::MAX
        } else {
            let step = acceleration * PERIOD;
            (step * step / 4.0 + 2.0 * acceleration * left.abs()).sqrt() - step / 2.0
        };
        let wanted = left.signum() * most.min(stopping).min(left.abs() / PERIOD);
        let change = if acceleration == 0.0 { f64::MAX } else { acceleration * PERIOD };
        self.profile_velocity = wanted.clamp(self.profile_velocity - change, self.profile_velocity + change);
        self.profile += self.profile_velocity * PERIOD;
    }
}
