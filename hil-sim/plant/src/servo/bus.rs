//! Several servos on one half-duplex wire, and what they move.

use vergence_dynamixel::Id;

use super::control::PERIOD;
use super::device::{Answer, Heard, Servo};
use super::line::{Nanoseconds, WireByte};

/// Where the output of a servo is, and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ServoMoment {
    /// Angle of the output in radians.
    pub angle: f64,
    /// Its velocity in radians per second.
    pub velocity: f64,
}

/// What the servos move.
pub trait Mechanism: Clone {
    /// The torques that act on the outputs from outside at `seconds` since the start, in newton metres, in the order of the servos.
    fn torques(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]);
}

/// Servos that move nothing but a constant load, none at first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Free {
    /// Torque on each output in newton metres; servos beyond the list carry none.
    pub loads: Vec<f64>,
}

impl Mechanism for Free {
    fn torques(&mut self, _seconds: f64, _outputs: &[ServoMoment], torques: &mut [f64]) {
        for (place, torque) in torques.iter_mut().enumerate() {
            *torque = self.loads.get(place).copied().unwrap_or_default();
        }
    }
}

/// Servos on one wire. The wire is open for each byte in turn: two who talk at once damage each other's bytes.
#[derive(Clone, Debug)]
pub struct ServoBus<M> {
    servos: Vec<Servo>,
    mechanism: M,
    /// What each servo still has to say: when its next byte begins, and the bytes.
    speaking: Vec<Option<Answer>>,
    /// End of the last byte that a servo sent.
    busy_until: Nanoseconds,
    heard_at: Nanoseconds,
    stepped_to: Nanoseconds,
    steps: u64,
    torques: Vec<f64>,
}

/// One step of the mechanics, a quarter of the loops' period.
const STEP: Nanoseconds = Nanoseconds(250_000);
const STEPS_OF_LOOPS: u64 = 4;
/// Bytes' time of silence after which a packet is over (assumed).
const QUIET_BYTES: u64 = 20;

impl<M: Mechanism> ServoBus<M> {
    /// Servos that move a mechanism.
    #[must_use]
    pub fn new(servos: Vec<Servo>, mechanism: M) -> Self {
        let count = servos.len();
        Self {
            servos,
            mechanism,
            speaking: vec![None; count],
            busy_until: Nanoseconds::default(),
            heard_at: Nanoseconds::default(),
            stepped_to: Nanoseconds::default(),
            steps: 0,
            torques: vec![0.0; count],
        }
    }

    /// The servos.
    #[must_use]
    pub fn servos(&self) -> &[Servo] {
        &self.servos
    }

    /// The servo of a number, to change it.
    pub fn servo_mut(&mut self, id: Id) -> Option<&mut Servo> {
        self.servos.iter_mut().find(|servo| servo.id() == Some(id))
    }

    /// What the servos move.
    #[must_use]
    pub fn mechanism(&self) -> &M {
        &self.mechanism
    }

    /// What the servos move, to change it.
    pub fn mechanism_mut(&mut self) -> &mut M {
        &mut self.mechanism
    }

    /// The torques on the outputs at the last step, in newton metres.
    #[must_use]
    pub fn torques(&self) -> &[f64] {
        &self.torques
    }

    /// Feeds all servos with so many volts from `now` on.
    pub fn set_supply(&mut self, volts: f64, now: Nanoseconds) {
        self.servos.iter_mut().for_each(|servo| servo.set_supply(volts, now));
    }

    /// Lets the mechanics move until `to`.
    pub fn advance(&mut self, to: Nanoseconds) {
        if self.servos.is_empty() {
            return;
        }
        while self.stepped_to.plus(STEP) <= to {
            self.stepped_to = self.stepped_to.plus(STEP);
            self.steps += 1;
            self.step();
        }
    }

    fn step(&mut self) {
        let outputs: Vec<ServoMoment> = self
            .servos
            .iter()
            .map(|servo| ServoMoment { angle: servo.motor().output(), velocity: servo.motor().velocity() })
            .collect();
        self.mechanism.torques(self.stepped_to.0 as f64 * 1e-9, &outputs, &mut self.torques);
        let loops = self.steps.is_multiple_of(STEPS_OF_LOOPS);
        for (servo, torque) in self.servos.iter_mut().zip(&self.torques) {
            servo.step_motor(PERIOD / STEPS_OF_LOOPS as f64, *torque);
            if loops {
                servo.step_loops(self.stepped_to);
            }
        }
    }

    /// The master has sent a byte, whose stop bit ends at `at`, at `baud` bits per second.
    pub fn receive(&mut self, at: Nanoseconds, byte: u8, baud: u32) {
        self.advance(at);
        let quiet = Nanoseconds::of_bytes(QUIET_BYTES, baud);
        if at.0.saturating_sub(self.heard_at.0) > quiet.0 {
            self.servos.iter_mut().for_each(Servo::line_is_quiet);
        }
        let began = at.0.saturating_sub(Nanoseconds::of_bytes(1, baud).0);
        let is_damaged = began < self.busy_until.0;
        self.deliver(Heard { at, byte, baud, is_damaged }, None);
    }

    /// A byte on the wire reaches all servos but the one that sends it.
    fn deliver(&mut self, heard: Heard, sender: Option<usize>) {
        self.heard_at = heard.at;
        for (place, (servo, speaking)) in self.servos.iter_mut().zip(&mut self.speaking).enumerate() {
            // A servo that talks does not listen.
            let listens = speaking.is_none() && Some(place) != sender;
            if let Some(answer) = listens.then(|| servo.hear(heard)).flatten() {
                *speaking = Some(answer);
            }
        }
    }

    /// When the next byte of a servo begins.
    #[must_use]
    pub fn next_event(&self) -> Option<Nanoseconds> {
        self.speaking.iter().flatten().map(|answer| answer.at).min()
    }

    /// The byte that begins now, at [`Self::next_event`]. Where several servos talk at once their bits mix.
    pub fn speak(&mut self, now: Nanoseconds) -> Option<WireByte> {
        self.advance(now);
        let mut spoken: Option<(WireByte, usize)> = None;
        let mut talkers = 0;
        for (place, speaking) in self.speaking.iter_mut().enumerate() {
            let Some(answer) = speaking else { continue };
            // Those who begin within this byte talk into it.
            let horizon = now.plus(Nanoseconds::of_bytes(1, answer.baud));
            if answer.at >= horizon {
                continue;
            }
            let Some(&byte) = answer.bytes.first() else {
                *speaking = None;
                continue;
            };
            answer.bytes.remove(0);
            answer.at = answer.at.plus(Nanoseconds::of_bytes(1, answer.baud));
            talkers += 1;
            spoken = Some(match spoken {
                None => (WireByte { at: now, byte, baud: answer.baud, is_damaged: false }, place),
                // A low bit wins on the wire.
                Some((with, first)) => (WireByte { byte: with.byte & byte, is_damaged: true, ..with }, first),
            });
        }
        let (byte, place) = spoken?;
        let end = now.plus(Nanoseconds::of_bytes(1, byte.baud));
        self.busy_until = end;
        let sender = (talkers == 1).then_some(place);
        // Before the others hear the end of the packet its sender has finished.
        for (servo, speaking) in self.servos.iter_mut().zip(&mut self.speaking) {
            if speaking.as_ref().is_some_and(|answer| answer.bytes.is_empty()) {
                *speaking = None;
                // It has not heard its own part of a combined answer, and waits for no rest of it.
                servo.line_is_quiet();
            }
        }
        self.deliver(Heard { at: end, byte: byte.byte, baud: byte.baud, is_damaged: byte.is_damaged }, sender);
        Some(byte)
    }
}
