//! Which question comes next, and how it stands on the wire.

use vergence_dynamixel::{Encoded, Full, Id, encode, table};
use vergence_protocol::{AxisList, Microseconds};

use super::{FAST_TRIES, Master, Transmission};
use crate::joints::exchange::{Exchange, Question};
use crate::joints::fault::JointFault;
use crate::joints::joint::{Block, HEALTH, Joint, MOTION, STATE};

/// One exchange of so many asks for voltage, temperature or state of one joint in turn.
const EXTRA_EVERY: u32 = 8;
/// A joint that was not heard is asked again whether its torque is off every so many exchanges.
const DEAF_EVERY: u32 = 16;
/// Bytes of an answer around its data: header, id, length, instruction, error, CRC.
const AROUND_ANSWER: usize = 11;
/// Bytes of a combined answer around its blocks, and of a block around its data.
const AROUND_COMBINED: usize = 8;
const AROUND_BLOCK: usize = 4;
/// Time that servos may take beyond the bytes themselves, in microseconds: once, and for each that answers.
const SLACK_US: u64 = 400;
const SLACK_OF_EACH_US: u64 = 100;
/// That of a servo which is not set up: its return delay is 500 us at most as it comes from the factory.
const SLACK_OF_SET_UP_US: u64 = 1_000;

impl Master {
    /// The next question; `None` where there is nobody to ask.
    pub(super) fn choose(&mut self) -> Option<Question> {
        self.turn = self.turn.wrapping_add(1);
        let any_read = self.joints.iter().any(Joint::is_read);
        // Every other exchange reads positions, whatever else is to be asked.
        if self.turn.is_multiple_of(2) || !any_read {
            let special = self.after_torque().or_else(|| self.of_set_up()).or_else(|| self.after_alert());
            if special.is_some() {
                return special;
            }
        }
        if let Some(joint) = (0..self.joints.len()).find(|joint| self.alone.contains(*joint)) {
            return Some(Question::Motion(joint));
        }
        if !any_read {
            return None;
        }
        if self.asks_each || !self.asks_fast() {
            return Some(Question::Sync);
        }
        Some(self.extra().unwrap_or(Question::Fast))
    }

    fn asks_fast(&self) -> bool {
        self.fast_works || self.fast_failures < FAST_TRIES
    }

    /// A joint that has not answered that its torque is as wanted.
    fn after_torque(&self) -> Option<Question> {
        let deaf_too = !self.torque && self.turn.is_multiple_of(DEAF_EVERY);
        let pending = |joint: &Joint| {
            let may_answer = joint.step.is_none() && (deaf_too || !joint.fault.is_some_and(JointFault::is_deaf));
            may_answer && self.is_torque_pending(joint)
        };
        // Each in turn: one that does not switch does not keep the others from being asked.
        let start = (self.turn / 2) as usize;
        let count = self.joints.len();
        (0..count)
            .map(|place| (start + place) % count)
            .find(|index| self.joints.get(*index).is_some_and(pending))
            .map(Question::State)
    }

    fn is_torque_pending(&self, joint: &Joint) -> bool {
        joint.torque != Some(self.torque) && (!self.torque || joint.is_driven())
    }

    fn of_set_up(&self) -> Option<Question> {
        let is_due = |joint: &Joint| joint.step.is_some() && joint.fault.is_none();
        let index = self.joints.iter().position(is_due)?;
        let joint = self.joints.get(index)?;
        Some(match joint.step {
            Some(0) if joint.reboots => Question::Reboot(index),
            Some(0) => Question::Ping(index),
            _ if joint.differs => Question::Write(index),
            _ => Question::Entry(index),
        })
    }

    fn after_alert(&self) -> Option<Question> {
        self.joints.iter().position(|joint| joint.alert && joint.is_driven()).map(Question::State)
    }

    /// Voltage, temperature or state of one joint, all in turn.
    fn extra(&self) -> Option<Question> {
        if !self.turn.is_multiple_of(EXTRA_EVERY) {
            return None;
        }
        let round = (self.turn / EXTRA_EVERY) as usize;
        let index = (round / 2) % self.joints.len().max(1);
        let question = if round.is_multiple_of(2) { Question::State(index) } else { Question::Health(index) };
        self.joints.get(index).filter(|joint| joint.is_read()).map(|_| question)
    }

    /// Writes a question, after torque and goals where these are to be written.
    pub(super) fn ask(&mut self, question: Question, now: Microseconds, crc_errors: u32) -> Result<Transmission, Full> {
        let mut bytes = Transmission::new();
        self.write_torque(&mut bytes)?;
        self.write_goals(&mut bytes)?;
        append(&mut bytes, &self.packet(question)?)?;
        let asked_at = Microseconds(now.0 + self.settings.time_of(bytes.len()));
        let awaited = self.asked(question);
        let until = Microseconds(asked_at.0 + self.patience(question, awaited.0.count_ones() as usize));
        let (stranger, refusal) = (false, None);
        self.exchange = Some(Exchange { question, asked_at, until, awaited, stranger, refusal, crc_errors });
        Ok(bytes)
    }

    /// Torque of all joints, until each has answered that it is as wanted.
    fn write_torque(&self, bytes: &mut Transmission) -> Result<(), Full> {
        if !self.joints.iter().any(|joint| joint.step.is_none() && self.is_torque_pending(joint)) {
            return Ok(());
        }
        let items: AxisList<(Id, [u8; 1])> = self
            .joints
            .iter()
            .filter(|joint| !self.torque || joint.is_driven())
            .map(|joint| (joint.settings.id, [self.torque.into()]))
            .collect();
        append(bytes, &encode::sync_write(table::TORQUE_ENABLE.address, &items)?)
    }

    fn write_goals(&self, bytes: &mut Transmission) -> Result<(), Full> {
        let driven = self.joints.iter().filter(|joint| self.torque && joint.is_driven());
        let items: AxisList<(Id, [u8; 4])> =
            driven.map(|joint| (joint.settings.id, joint.goal.0.to_le_bytes())).collect();
        if items.is_empty() {
            return Ok(());
        }
        append(bytes, &encode::sync_write(table::GOAL_POSITION.address, &items)?)
    }

    fn packet(&self, question: Question) -> Result<Encoded, Full> {
        let id = |joint: usize| self.joints.get(joint).map_or(Id::BROADCAST, |joint| joint.settings.id);
        let ids = || self.joints.iter().filter(|joint| joint.is_read()).map(|joint| joint.settings.id);
        let read = |joint: usize, block: Block| encode::read(id(joint), block.address, block.length);
        match question {
            Question::Reboot(joint) => encode::reboot(id(joint)),
            Question::Ping(joint) => encode::ping(id(joint)),
            Question::Motion(joint) => read(joint, MOTION),
            Question::State(joint) => read(joint, STATE),
            Question::Health(joint) => read(joint, HEALTH),
            Question::Fast => encode::fast_sync_read(MOTION.address, MOTION.length, &ids().collect::<AxisList<Id>>()),
            Question::Sync => encode::sync_read(MOTION.address, MOTION.length, &ids().collect::<AxisList<Id>>()),
            Question::Entry(joint) => match self.entry(joint, 0) {
                Some((register, _)) => encode::read(id(joint), register.address, register.width),
                None => encode::ping(id(joint)),
            },
            Question::Write(joint) => match self.entry(joint, 0) {
                Some((register, value)) => {
                    let value = value.to_le_bytes();
                    let data = value.get(..usize::from(register.width)).unwrap_or_default();
                    encode::write(id(joint), register.address, data)
                }
                None => encode::ping(id(joint)),
            },
        }
    }

    /// Longest time from the end of a question to the end of its answers, in microseconds.
    fn patience(&self, question: Question, joints: usize) -> u64 {
        let motion = usize::from(MOTION.length);
        let alone = |data: usize| AROUND_ANSWER + data;
        let (bytes, slack) = match question {
            Question::Fast => (AROUND_COMBINED + joints * (AROUND_BLOCK + motion), SLACK_US),
            Question::Sync => (joints * alone(motion), SLACK_US),
            Question::Motion(_) => (alone(motion), SLACK_US),
            Question::State(_) => (alone(STATE.length.into()), SLACK_US),
            Question::Health(_) => (alone(HEALTH.length.into()), SLACK_US),
            Question::Reboot(_) | Question::Ping(_) | Question::Entry(_) | Question::Write(_) => {
                (alone(4), SLACK_OF_SET_UP_US)
            }
        };
        self.settings.time_of(bytes) + slack + SLACK_OF_EACH_US * joints as u64
    }
}

fn append(bytes: &mut Transmission, packet: &[u8]) -> Result<(), Full> {
    bytes.extend_from_slice(packet).map_err(|_| Full)
}
