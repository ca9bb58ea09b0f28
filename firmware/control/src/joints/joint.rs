//! What the master knows of one joint.

use vergence_dynamixel::table::{self, Register};
use vergence_dynamixel::units::{BusWatchdog, Current, HardwareErrors, Position, Velocity, Voltage};
use vergence_protocol::Microseconds;

use super::fault::JointFault;
use super::settings::JointSettings;

/// Position and load of a joint at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointReading {
    /// When the servo was asked for it, board clock.
    pub at: Microseconds,
    /// Position of the output.
    pub position: Position,
    /// Its velocity.
    pub velocity: Velocity,
    /// Current of its motor.
    pub current: Current,
}

/// What is read now and then.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointHealth {
    /// Supply of the servo.
    pub voltage: Voltage,
    /// Temperature in degrees Celsius.
    pub celsius: u8,
}

/// One joint.
#[derive(Clone, Debug)]
pub struct Joint {
    pub(super) settings: JointSettings,
    /// Step of the set-up; `None` where that is done.
    pub(super) step: Option<u8>,
    pub(super) goal: Position,
    pub(super) reading: Option<JointReading>,
    /// What it has answered in an exchange in which each answers: taken when all are known to have spoken for themselves.
    pub(super) pending: Option<JointReading>,
    pub(super) health: Option<JointHealth>,
    /// Whether torque is on, as read since it was last switched.
    pub(super) torque: Option<bool>,
    /// How often torque was switched and found as before.
    pub(super) torque_tries: u8,
    /// Failures of exchanges with this joint alone, one after the other.
    pub(super) failures: u8,
    /// Whether the register of the present step of the set-up has another value than it should.
    pub(super) differs: bool,
    /// Whether that register was written.
    pub(super) is_written: bool,
    /// Whether its answers carry the alert of a hardware error that was not looked at yet.
    pub(super) alert: bool,
    /// Whether it is to be started anew.
    pub(super) reboots: bool,
    pub(super) fault: Option<JointFault>,
}

/// Registers that are read in each cycle, from moving to position.
pub(super) const MOTION: Block = Block::spanning(&table::PRESENT_CURRENT, &table::PRESENT_POSITION);
/// Registers that tell whether the joint holds, from torque to bus watchdog.
pub(super) const STATE: Block = Block::spanning(&table::TORQUE_ENABLE, &table::BUS_WATCHDOG);
/// Registers that are read now and then: voltage and temperature.
pub(super) const HEALTH: Block = Block::spanning(&table::PRESENT_INPUT_VOLTAGE, &table::PRESENT_TEMPERATURE);

/// Registers next to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub address: u16,
    pub length: u16,
}

impl Block {
    const fn spanning(first: &Register, last: &Register) -> Self {
        Self { address: first.address, length: last.end() - first.address }
    }

    /// The bytes of a register in the data of this block; `None` where the data are of another length.
    fn bytes<const N: usize>(self, data: &[u8], register: &Register) -> Option<[u8; N]> {
        if data.len() != usize::from(self.length) {
            return None;
        }
        let start = usize::from(register.address.checked_sub(self.address)?);
        data.get(start..start + N)?.try_into().ok()
    }
}

impl Joint {
    pub(super) fn new(settings: JointSettings) -> Self {
        let goal = Position::default();
        let (reading, pending, health, torque, fault) = (None, None, None, None, None);
        let (torque_tries, failures, differs, is_written, alert, reboots) = (0, 0, false, false, false, false);
        Self {
            settings,
            step: None,
            goal,
            reading,
            pending,
            health,
            torque,
            torque_tries,
            failures,
            differs,
            is_written,
            alert,
            reboots,
            fault,
        }
        .begin()
    }

    /// Forgets everything but the latest position: the set-up begins again.
    pub(super) fn begin(self) -> Self {
        let (torque_tries, failures, differs, is_written, alert) = (0, 0, false, false, false);
        let (step, torque, fault) = (Some(0), None, None);
        Self { step, torque, torque_tries, failures, differs, is_written, alert, reboots: false, fault, ..self }
    }

    /// Goes on to the next step of the set-up.
    pub(super) fn next_step(&mut self, is_last: bool) {
        (self.differs, self.is_written) = (false, false);
        self.step = self.step.filter(|_| !is_last).map(|step| step.saturating_add(1));
    }

    /// Latest position; `None` before the first.
    #[must_use]
    pub fn reading(&self) -> Option<JointReading> {
        self.reading
    }

    /// Latest voltage and temperature; `None` before the first.
    #[must_use]
    pub fn health(&self) -> Option<JointHealth> {
        self.health
    }

    /// Why it cannot be used.
    #[must_use]
    pub fn fault(&self) -> Option<JointFault> {
        self.fault
    }

    /// Whether it is set up, has answered with a position and has no fault.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.step.is_none() && self.fault.is_none() && self.reading.is_some()
    }

    /// Whether torque is on, as the joint itself answered since torque was last switched.
    #[must_use]
    pub fn torque(&self) -> Option<bool> {
        self.torque
    }

    /// Whether it is asked for its position in each cycle.
    pub(super) fn is_read(&self) -> bool {
        self.step.is_none() && !self.fault.is_some_and(JointFault::is_deaf)
    }

    /// Whether it gets goals.
    pub(super) fn is_driven(&self) -> bool {
        self.step.is_none() && self.fault.is_none()
    }

    /// Keeps the first fault.
    pub(super) fn fail(&mut self, fault: JointFault) {
        self.fault.get_or_insert(fault);
    }

    /// Takes the registers of [`MOTION`]; whether they were that.
    pub(super) fn take_motion(&mut self, at: Microseconds, data: &[u8]) -> bool {
        let reading = reading_of(at, data);
        self.reading = reading.or(self.reading);
        reading.is_some()
    }

    /// Keeps the registers of [`MOTION`] until [`Self::settle_pending`]; whether they were that.
    pub(super) fn await_others(&mut self, at: Microseconds, data: &[u8]) -> bool {
        self.pending = reading_of(at, data);
        self.pending.is_some()
    }

    /// Takes what was kept, or drops it where another servo has answered under somebody's number.
    pub(super) fn settle_pending(&mut self, is_sound: bool) {
        self.reading = self.pending.take().filter(|_| is_sound).or(self.reading);
    }

    /// Takes the registers of [`STATE`]; whether they were that. `wanted` is whether torque should be on.
    pub(super) fn take_state(&mut self, wanted: bool, data: &[u8]) -> bool {
        let Some([torque]) = STATE.bytes(data, &table::TORQUE_ENABLE) else { return false };
        let Some([errors]) = STATE.bytes(data, &table::HARDWARE_ERROR_STATUS) else { return false };
        let Some([watchdog]) = STATE.bytes(data, &table::BUS_WATCHDOG) else { return false };
        self.alert = false;
        let (is_on, errors) = (torque != 0, HardwareErrors(errors));
        let had = self.torque.replace(is_on);
        if !errors.is_empty() {
            self.fail(JointFault::Hardware(errors));
        } else if BusWatchdog(watchdog.cast_signed()) == BusWatchdog::BITTEN {
            self.fail(JointFault::TorqueLost);
        } else if wanted && !is_on {
            self.torque_tries = self.torque_tries.saturating_add(1);
            if had == Some(true) || self.torque_tries >= TORQUE_TRIES {
                self.fail(JointFault::TorqueLost);
            }
        }
        true
    }

    /// Takes the registers of [`HEALTH`]; whether they were that.
    pub(super) fn take_health(&mut self, data: &[u8]) -> bool {
        let health = || {
            let voltage = u16::from_le_bytes(HEALTH.bytes(data, &table::PRESENT_INPUT_VOLTAGE)?);
            let [celsius] = HEALTH.bytes(data, &table::PRESENT_TEMPERATURE)?;
            Some(JointHealth { voltage: Voltage(voltage), celsius })
        };
        let health = health();
        self.health = health.or(self.health);
        health.is_some()
    }
}

/// The registers of [`MOTION`] in these data; `None` where they are others.
fn reading_of(at: Microseconds, data: &[u8]) -> Option<JointReading> {
    Some(JointReading {
        at,
        position: Position(i32::from_le_bytes(MOTION.bytes(data, &table::PRESENT_POSITION)?)),
        velocity: Velocity(i32::from_le_bytes(MOTION.bytes(data, &table::PRESENT_VELOCITY)?)),
        current: Current(i16::from_le_bytes(MOTION.bytes(data, &table::PRESENT_CURRENT)?)),
    })
}

/// How often torque is switched on before a joint counts as one that does not.
const TORQUE_TRIES: u8 = 3;
