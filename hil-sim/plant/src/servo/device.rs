//! One servo: what it does with instructions, and what happens in it as time passes.

use vergence_dynamixel::units::{Baud, BusWatchdog, HardwareErrors, ReturnDelay};
use vergence_dynamixel::{Id, Receiver, table};

use super::control::{COUNT, CURRENT, Loops, PERIOD, Shown, VELOCITY};
use super::faults::ServoFaults;
use super::line::Nanoseconds;
use super::model::ServoModel;
use super::motor::{Drive, Motor};
use super::registers::Registers;

mod instructions;

use instructions::Turn;
pub use instructions::{Answer, Heard};

/// Below this supply its processor does not run, in volts (assumed).
const BROWN_OUT: f64 = 6.0;

/// A simulated servo.
#[derive(Clone, Debug)]
pub struct Servo {
    model: ServoModel,
    registers: Registers,
    motor: Motor,
    loops: Loops,
    drive: Drive,
    faults: ServoFaults,
    errors: HardwareErrors,
    supply: f64,
    overloaded_for: f64,
    /// Whole turns that the position does not show.
    turns: f64,
    /// The position that a broken encoder shows, in radians.
    frozen: Option<f64>,
    receiver: Receiver,
    /// A write that waits for its action.
    registered: Option<(u16, Vec<u8>)>,
    /// Its place in a read of several servos.
    turn: Option<Turn>,
    heard_at: Nanoseconds,
    deaf_until: Nanoseconds,
}

impl Servo {
    /// A servo as from the factory with this number and speed, at rest with its output at `angle` in radians, fed with the rated
    /// voltage.
    #[must_use]
    pub fn new(model: ServoModel, id: Id, baud: Baud, angle: f64) -> Self {
        let mut registers = Registers::new(&model);
        registers.set(&table::ID, i64::from(id.get()));
        registers.set(&table::BAUD_RATE, i64::from(baud.register()));
        let mut servo = Self {
            model,
            registers,
            motor: Motor::new(model, angle),
            loops: Loops::default(),
            drive: Drive::Open,
            faults: ServoFaults::default(),
            errors: HardwareErrors::default(),
            supply: model.rated_voltage,
            overloaded_for: 0.0,
            turns: 0.0,
            frozen: None,
            receiver: Receiver::default(),
            registered: None,
            turn: None,
            heard_at: Nanoseconds::default(),
            deaf_until: Nanoseconds::default(),
        };
        servo.restart(Nanoseconds::default());
        servo
    }

    /// The mechanics.
    #[must_use]
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// The mechanics, to block, warm or turn them.
    pub fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    /// The registers.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Faults, to inject some.
    pub fn faults_mut(&mut self) -> &mut ServoFaults {
        &mut self.faults
    }

    /// Whether torque is on.
    #[must_use]
    pub fn has_torque(&self) -> bool {
        self.registers.get(&table::TORQUE_ENABLE) != 0
    }

    /// Hardware errors since the last start.
    #[must_use]
    pub fn errors(&self) -> HardwareErrors {
        self.errors
    }

    /// Feeds the servo with so many volts from `now` on. Without power it forgets its RAM and starts anew when power returns.
    pub fn set_supply(&mut self, volts: f64, now: Nanoseconds) {
        let was_off = self.supply < BROWN_OUT;
        self.supply = volts;
        if volts < BROWN_OUT {
            self.registers.set(&table::TORQUE_ENABLE, 0);
            self.drive = Drive::Open;
        } else if was_off {
            self.reboot(now);
        }
    }

    /// Whether it hears and answers.
    fn is_alive(&self, now: Nanoseconds) -> bool {
        self.supply >= BROWN_OUT && !self.faults.is_silent && now >= self.deaf_until
    }

    fn reboot(&mut self, now: Nanoseconds) {
        self.restart(now.plus(Nanoseconds::microseconds(self.model.boot_ms * 1_000)));
    }

    fn restart(&mut self, listens_from: Nanoseconds) {
        self.registers.restart(&self.model);
        self.errors = HardwareErrors::default();
        self.overloaded_for = 0.0;
        self.drive = Drive::Open;
        self.registered = None;
        self.turn = None;
        self.receiver.clear();
        self.deaf_until = listens_from;
        self.heard_at = listens_from;
        self.forget_turns();
        self.refresh(listens_from);
        let here = self.registers.get(&table::PRESENT_POSITION);
        self.registers.set(&table::GOAL_POSITION, here);
    }

    /// The position shows less than a turn from here on.
    fn forget_turns(&mut self) {
        self.turns = 0.0;
        self.turns = (self.shown_angle() / std::f64::consts::TAU).floor();
    }

    fn is_reversed(&self) -> bool {
        self.registers.get(&table::DRIVE_MODE) & 1 == 1
    }

    /// The angle of the encoder with the direction of the drive mode, in radians.
    fn shown_angle(&self) -> f64 {
        let angle = self.frozen.unwrap_or_else(|| self.motor.output());
        (if self.is_reversed() { -angle } else { angle }) - self.turns * std::f64::consts::TAU
    }

    fn shown(&self) -> Shown {
        let counts = (self.shown_angle() / COUNT).floor() + self.registers.get(&table::HOMING_OFFSET) as f64;
        let velocity = if self.frozen.is_some() { 0.0 } else { self.motor.velocity() };
        Shown { position: counts, velocity: if self.is_reversed() { -velocity } else { velocity } }
    }

    /// Lets `dt` seconds of mechanics pass under a torque from outside, in newton metres.
    pub(super) fn step_motor(&mut self, dt: f64, load: f64) {
        let drive = match (self.drive, self.is_reversed()) {
            (Drive::Voltage { volts, limit }, true) => Drive::Voltage { volts: -volts, limit },
            (drive, _) => drive,
        };
        self.motor.step(dt, drive, load);
    }

    /// One period of the servo's own loops and watches.
    pub(super) fn step_loops(&mut self, now: Nanoseconds) {
        if self.supply < BROWN_OUT {
            return;
        }
        self.frozen = match (self.faults.encoder_broken, self.frozen) {
            (false, _) => None,
            (true, frozen) => frozen.or(Some(self.motor.output())),
        };
        self.watch_bus(now);
        self.watch_hardware();
        if self.has_torque() {
            self.drive = self.loops.step(&self.registers, self.shown(), self.supply);
        } else {
            self.drive = Drive::Open;
            self.loops.start(self.shown().position);
        }
        self.refresh(now);
    }

    /// The bus watchdog stops a servo with torque that hears no instruction.
    fn watch_bus(&mut self, now: Nanoseconds) {
        let value = i8::try_from(self.registers.get(&table::BUS_WATCHDOG)).unwrap_or_default();
        let Some(limit) = BusWatchdog(value).milliseconds() else { return };
        let silence = now.0.saturating_sub(self.heard_at.0);
        if self.has_torque() && silence > u64::from(limit) * 1_000_000 {
            self.registers.bite();
            self.registers.set(&table::PROFILE_ACCELERATION, 0);
            self.registers.set(&table::PROFILE_VELOCITY, 0);
            self.loops.start(self.shown().position);
            self.loops.halted = true;
        }
    }

    fn watch_hardware(&mut self) {
        let value = |register| self.registers.get(register) as f64;
        let mut errors = self.errors;
        let decivolts = self.supply * 10.0;
        if decivolts > value(&table::MAX_VOLTAGE_LIMIT) || decivolts < value(&table::MIN_VOLTAGE_LIMIT) {
            errors = errors.with(HardwareErrors::INPUT_VOLTAGE);
        }
        if self.motor.temperature() > value(&table::TEMPERATURE_LIMIT) {
            errors = errors.with(HardwareErrors::OVERHEATING);
        }
        if self.faults.encoder_broken {
            errors = errors.with(HardwareErrors::ENCODER);
        }
        let largest = self.model.overload_share * self.supply / self.model.resistance();
        let too_much = self.motor.current().abs() >= largest;
        self.overloaded_for = if too_much { self.overloaded_for + PERIOD } else { 0.0 };
        if self.overloaded_for > self.model.overload_time {
            errors = errors.with(HardwareErrors::OVERLOAD);
        }
        self.errors = errors;
        let shutdown = u8::try_from(self.registers.get(&table::SHUTDOWN)).unwrap_or_default();
        if errors.intersects(HardwareErrors(shutdown)) {
            self.registers.set(&table::TORQUE_ENABLE, 0);
        }
    }

    /// Whether torque is locked until the next start.
    fn is_shut_down(&self) -> bool {
        let shutdown = u8::try_from(self.registers.get(&table::SHUTDOWN)).unwrap_or_default();
        self.errors.intersects(HardwareErrors(shutdown))
    }

    /// Puts what the servo senses into its registers.
    fn refresh(&mut self, now: Nanoseconds) {
        let shown = self.shown();
        let sign = if self.is_reversed() { -1.0 } else { 1.0 };
        let moving = (shown.velocity / VELOCITY).abs() > self.registers.get(&table::MOVING_THRESHOLD) as f64;
        let milliseconds = now.0 / 1_000_000 % 32_768;
        for (register, value) in [
            (&table::PRESENT_POSITION, shown.position),
            (&table::PRESENT_VELOCITY, (shown.velocity / VELOCITY).round()),
            (&table::PRESENT_CURRENT, (sign * self.motor.current() / CURRENT).round()),
            (&table::PRESENT_PWM, self.loops.pwm.round()),
            (&table::PRESENT_INPUT_VOLTAGE, (self.supply * 10.0).round()),
            (&table::PRESENT_TEMPERATURE, self.motor.temperature().round()),
            (&table::POSITION_TRAJECTORY, self.loops.profile.round()),
            (&table::VELOCITY_TRAJECTORY, (self.loops.profile_velocity * COUNT / VELOCITY).round()),
            (&table::MOVING, f64::from(u8::from(moving))),
            (&table::HARDWARE_ERROR_STATUS, f64::from(self.errors.0)),
            (&table::REGISTERED_INSTRUCTION, f64::from(u8::from(self.registered.is_some()))),
            (&table::REALTIME_TICK, milliseconds as f64),
        ] {
            self.registers.set(register, value as i64);
        }
    }

    /// Delay before its answers.
    fn return_delay(&self) -> Nanoseconds {
        let delay = u8::try_from(self.registers.get(&table::RETURN_DELAY_TIME)).unwrap_or(u8::MAX);
        Nanoseconds::microseconds(u64::from(ReturnDelay(delay).microseconds()))
    }

    /// The speed at which it listens and talks, in bits per second.
    #[must_use]
    pub fn baud(&self) -> u32 {
        let register = u8::try_from(self.registers.get(&table::BAUD_RATE)).unwrap_or_default();
        Baud::of_register(register).unwrap_or(Baud::B57600).bits_per_second()
    }

    /// Its number.
    #[must_use]
    pub fn id(&self) -> Option<Id> {
        u8::try_from(self.registers.get(&table::ID)).ok().and_then(|number| Id::servo(number).ok())
    }
}
