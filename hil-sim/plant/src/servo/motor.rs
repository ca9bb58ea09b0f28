//! Motor, gears and housing: what the bridge's voltage makes of angle, current and temperature.

use super::ServoModel;

/// Whether and how the motor is fed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// The bridge is open: torque is off.
    Open,
    /// The bridge applies this voltage, unless the current would exceed the limit in amperes.
    Voltage {
        /// Volts, with sign.
        volts: f64,
        /// Largest current in amperes.
        limit: f64,
    },
}

/// The mechanics of one servo. Angles in radians and velocities in radians per second, at the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    model: ServoModel,
    /// Angle of the motor behind the gears.
    rotor: f64,
    velocity: f64,
    /// Angle of the output, within the play of the motor's.
    output: f64,
    current: f64,
    temperature: f64,
    /// Whether something holds the output so that it cannot move.
    pub blocked: bool,
}

/// Seconds in which a load pushes the output through its play.
const PLAY_TIME: f64 = 5e-3;
/// Below this load the output rests where it is within its play: friction of its bearing, in newton metres (assumed).
const RESTING_LOAD: f64 = 0.01;

impl Motor {
    /// A motor at rest at `angle`, as warm as the air around it.
    #[must_use]
    pub fn new(model: ServoModel, angle: f64) -> Self {
        let temperature = model.ambient;
        Self { model, rotor: angle, velocity: 0.0, output: angle, current: 0.0, temperature, blocked: false }
    }

    /// The angle of the output.
    #[must_use]
    pub fn output(&self) -> f64 {
        self.output
    }

    /// The velocity of the motor, at the output.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The motor's current in amperes, positive where it turns the output to larger angles.
    #[must_use]
    pub fn current(&self) -> f64 {
        self.current
    }

    /// Degrees Celsius.
    #[must_use]
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Makes it so warm, in degrees Celsius.
    pub fn set_temperature(&mut self, celsius: f64) {
        self.temperature = celsius;
    }

    /// Puts output and motor at an angle, at rest, as a hand does that turns it without power.
    pub fn put_at(&mut self, angle: f64) {
        (self.rotor, self.output, self.velocity) = (angle, angle, 0.0);
    }

    /// Lets `dt` seconds pass, short against 15 ms, the time constant of the motor. `load` is the torque that acts on the
    /// output from outside, in newton metres.
    pub fn step(&mut self, dt: f64, drive: Drive, load: f64) {
        let model = self.model;
        self.current = match drive {
            Drive::Open => 0.0,
            Drive::Voltage { volts, limit } => {
                ((volts - model.back_emf() * self.velocity) / model.resistance()).clamp(-limit, limit)
            }
        };
        let push = self.current * model.torque_constant() + load - model.viscous * self.velocity;
        let free = self.velocity + push / model.inertia * dt;
        // Coulomb friction takes velocity away and never turns it round.
        let friction = model.coulomb / model.inertia * dt;
        self.velocity = if free.abs() <= friction { 0.0 } else { free - friction * free.signum() };
        if self.blocked {
            self.velocity = 0.0;
        }
        self.rotor += self.velocity * dt;
        self.follow(dt, load);
        let heat = self.current * self.current * model.resistance();
        let flow = (self.temperature - model.ambient) / model.thermal_resistance;
        self.temperature += (heat - flow) / model.heat_capacity * dt;
    }

    /// The output follows the motor within its play, at the side to which the load pushes it.
    fn follow(&mut self, dt: f64, load: f64) {
        let half = self.model.backlash / 2.0;
        if load.abs() > RESTING_LOAD && !self.blocked {
            let side = self.rotor + half * load.signum();
            self.output += (side - self.output) * (dt / PLAY_TIME).min(1.0);
        }
        self.output = self.output.clamp(self.rotor - half, self.rotor + half);
    }
}
