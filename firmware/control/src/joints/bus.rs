//! The master of the bus: what is asked next, and what follows from an answer or its absence.

mod answers;
mod questions;

use heapless::Vec;
use vergence_dynamixel::units::Position;
use vergence_dynamixel::{Full, MAX_PACKET, Receiver};
use vergence_protocol::{AxisList, AxisMask, Microseconds};

use super::exchange::{Exchange, Question};
use super::fault::{BusCounters, JointFault};
use super::joint::Joint;
use super::settings::BusSettings;

/// Packets that are sent one right after the other.
pub type Transmission = Vec<u8, MAX_PACKET>;

/// Failures of a joint asked alone, one after the other, at which it has a fault.
const MOST_FAILURES: u8 = 2;
/// Combined answers that fail before the first success while single answers come: then the servos do not know them.
const FAST_TRIES: u8 = 3;

/// The master of a bus. Time and bytes are arguments.
#[derive(Clone, Debug)]
pub struct JointBus {
    receiver: Receiver,
    master: Master,
}

/// All of it but the receiver, which lends its packets.
#[derive(Clone, Debug)]
struct Master {
    settings: BusSettings,
    joints: AxisList<Joint>,
    exchange: Option<Exchange>,
    /// Whether torque shall be on.
    torque: bool,
    /// Whether combined answers are known to work, and how often they failed before that was known.
    fast_works: bool,
    fast_failures: u8,
    /// Whether a combined answer has failed and each joint is asked for an answer of its own.
    asks_each: bool,
    /// Joints that failed then, and are asked alone.
    alone: AxisMask,
    turn: u32,
    counters: BusCounters,
}

impl JointBus {
    /// A master that has sent nothing yet. Torque is off.
    #[must_use]
    pub fn new(settings: BusSettings) -> Self {
        let joints = settings.joints.iter().map(|&joint| Joint::new(joint)).collect();
        let master = Master {
            settings,
            joints,
            exchange: None,
            torque: false,
            fast_works: false,
            fast_failures: 0,
            asks_each: false,
            alone: AxisMask::default(),
            turn: 0,
            counters: BusCounters::default(),
        };
        Self { receiver: Receiver::default(), master }
    }

    /// The joints, in the order of the settings.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.master.joints
    }

    /// What was counted since the start.
    #[must_use]
    pub fn counters(&self) -> BusCounters {
        self.master.counters
    }

    /// Whether all joints are set up and without fault.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.master.joints.iter().all(Joint::is_ready)
    }

    /// Whether each joint has answered that its torque is off, since that was last asked for.
    #[must_use]
    pub fn torque_is_off(&self) -> bool {
        !self.master.torque && self.master.joints.iter().all(|joint| joint.torque == Some(false))
    }

    /// Where joint number `joint` shall be, from the next exchange on. A joint that is not there is ignored.
    pub fn set_goal(&mut self, joint: usize, goal: Position) {
        if let Some(joint) = self.master.joints.get_mut(joint) {
            joint.goal = goal;
        }
    }

    /// Switches torque of all joints with the next exchange, and again until each has answered that it is so. Torque goes on
    /// where the joints are: set goals after this.
    pub fn set_torque(&mut self, on: bool) {
        let master = &mut self.master;
        master.torque = on;
        for joint in &mut master.joints {
            joint.torque = None;
            joint.torque_tries = 0;
            if let Some(reading) = joint.reading.filter(|_| on) {
                joint.goal = reading.position;
            }
        }
    }

    /// Sets those joints up again that have a fault. A servo that has found errors of its hardware is started anew before, which
    /// clears them. Torque must be off.
    pub fn recover(&mut self) {
        for joint in &mut self.master.joints {
            if let Some(fault) = joint.fault {
                *joint = joint.clone().begin();
                joint.reboots = matches!(fault, JointFault::Hardware(_));
            }
        }
    }

    /// Takes bytes from the wire, in any portions.
    pub fn hear(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let before = bytes.len();
            bytes = self.receiver.hear(bytes);
            self.take_packets();
            if bytes.len() == before {
                // It is full of what never becomes a packet.
                self.receiver.clear();
            }
        }
    }

    fn take_packets(&mut self) {
        while let Some(packet) = self.receiver.next_packet() {
            self.master.take(&packet);
        }
    }

    /// What is to be sent now, if anything; call it at least once each millisecond, and give [`Self::hear`] before what has
    /// arrived. Sending begins at `now`.
    ///
    /// # Errors
    /// [`Full`] never with up to [`vergence_protocol::MAX_AXES`] joints.
    pub fn poll(&mut self, now: Microseconds) -> Result<Option<Transmission>, Full> {
        if let Some(exchange) = &self.master.exchange {
            let is_answered = exchange.awaited == AxisMask::default() || exchange.refusal.is_some();
            if !is_answered && now < exchange.until {
                return Ok(None);
            }
            if !is_answered {
                self.receiver.line_is_quiet();
                self.take_packets();
            }
            self.master.conclude(self.receiver.counters().crc_errors);
        }
        // What is left is not an answer to the next question.
        self.receiver.clear();
        let Some(question) = self.master.choose() else { return Ok(None) };
        self.master.ask(question, now, self.receiver.counters().crc_errors).map(Some)
    }
}

impl Master {
    fn asked(&self, question: Question) -> AxisMask {
        match question.joint() {
            Some(joint) => AxisMask::default().with(joint),
            None => self.mask(Joint::is_read),
        }
    }

    fn mask(&self, which: impl Fn(&Joint) -> bool) -> AxisMask {
        let chosen = self.joints.iter().enumerate().filter(|(_, joint)| which(joint));
        chosen.fold(AxisMask::default(), |mask, (index, _)| mask.with(index))
    }

    /// The exchange is over: judges who has not answered.
    fn conclude(&mut self, crc_errors: u32) {
        let Some(exchange) = self.exchange.take() else { return };
        let is_answered = exchange.awaited == AxisMask::default();
        let garbled = exchange.crc_errors != crc_errors;
        if !is_answered && exchange.refusal.is_none() {
            let count = if garbled { &mut self.counters.garbled } else { &mut self.counters.timeouts };
            *count = count.saturating_add(1);
        }
        match exchange.question {
            Question::Fast => self.conclude_fast(is_answered),
            Question::Sync => {
                self.asks_each = false;
                self.alone = self.doubtful(exchange.awaited);
                let doubtful = self.alone;
                let joints = self.joints.iter_mut().enumerate();
                joints.for_each(|(index, joint)| joint.settle_pending(!doubtful.contains(index)));
                self.counters.cycles = self.counters.cycles.saturating_add(u32::from(is_answered));
            }
            _ => self.conclude_alone(&exchange, is_answered, garbled),
        }
    }

    /// The joints whose answers to a question to each are not to be believed where those `missing` have not answered. They answer
    /// in their order, so that from the first missing one on an answer may be another's with a wrong number.
    fn doubtful(&self, missing: AxisMask) -> AxisMask {
        let first = (0..self.joints.len()).find(|&joint| missing.contains(joint)).unwrap_or(self.joints.len());
        AxisMask(self.mask(Joint::is_read).0 & !AxisMask::first(first).0)
    }

    fn conclude_fast(&mut self, is_answered: bool) {
        if is_answered {
            self.fast_works = true;
            self.counters.cycles = self.counters.cycles.saturating_add(1);
        } else {
            self.fast_failures = self.fast_failures.saturating_add(u8::from(!self.fast_works));
            self.asks_each = true;
        }
    }

    fn conclude_alone(&mut self, exchange: &Exchange, is_answered: bool, garbled: bool) {
        let Some(index) = exchange.question.joint() else { return };
        let Some(joint) = self.joints.get_mut(index) else { return };
        self.alone.0 &= !AxisMask::default().with(index).0;
        // Its answer may be lost in its start; the ping that follows tells.
        joint.reboots &= !matches!(exchange.question, Question::Reboot(_));
        if is_answered || matches!(exchange.question, Question::Reboot(_)) {
            joint.failures = 0;
            return;
        }
        joint.failures = joint.failures.saturating_add(1);
        if joint.failures >= MOST_FAILURES {
            joint.failures = 0;
            joint.fail(match exchange.refusal {
                Some(refusal) => JointFault::Refused(Some(refusal)),
                None if exchange.stranger => JointFault::WrongId,
                None if garbled => JointFault::Garbled,
                None => JointFault::Silent,
            });
        } else if exchange.question == Question::Motion(index) {
            self.alone = self.alone.with(index);
        }
    }
}
