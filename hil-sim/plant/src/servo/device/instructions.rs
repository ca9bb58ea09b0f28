//! Instructions and answers of one servo.

use vergence_dynamixel::answer::{self, FastPart};
use vergence_dynamixel::{Id, Instruction, Malformed, Packet, ResetScope, StatusError, table};

use super::super::faults::ServoFaults;
use super::super::line::Nanoseconds;
use super::super::registers::Registers;
use super::{Drive, Servo};

/// Bytes that a servo will send.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// When the first byte begins.
    pub at: Nanoseconds,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Speed of the line in bits per second.
    pub baud: u32,
}

/// A byte on the wire, as a servo hears it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// The end of its stop bit.
    pub at: Nanoseconds,
    /// The data bits.
    pub byte: u8,
    /// Speed of the line in bits per second.
    pub baud: u32,
    /// Whether another talked at the same time.
    pub is_damaged: bool,
}

/// The place of a servo in a read of several: it answers when those before it have.
///
/// Assumed, since the manual does not say: a servo whose predecessor stays silent stays silent itself.
#[derive(Clone, Debug)]
pub(super) struct Turn {
    /// What it will send, once it is its turn.
    error: u8,
    data: Vec<u8>,
    id: Id,
    kind: TurnKind,
}

#[derive(Clone, Debug)]
enum TurnKind {
    /// After the answer of this servo.
    After(u8),
    /// In one packet with the others: bytes heard so far, and those that come before its own.
    Fast { lengths: Vec<u16>, place: usize, before: Vec<u8>, expected: usize },
}

/// Beyond this share the speeds of talker and listener differ too much: half a bit in ten.
const TOLERATED: f64 = 0.04;
const HEADER_BYTES: usize = 8;
const AROUND_DATA: usize = 4;
/// Bytes of the answer to a ping.
const PING_ANSWER: u64 = 14;

impl Servo {
    /// Takes a byte from the wire; what the servo sends in answer to it.
    pub fn hear(&mut self, heard: Heard) -> Option<Answer> {
        if !self.is_alive(heard.at) {
            return None;
        }
        let differs = (f64::from(heard.baud) / f64::from(self.baud()) - 1.0).abs() > TOLERATED;
        let byte = if differs || heard.is_damaged { heard.byte.rotate_left(3) ^ 0xA5 } else { heard.byte };
        if let Some(answer) = self.hear_chain(byte, heard.at) {
            return Some(answer);
        }
        let mut receiver = std::mem::take(&mut self.receiver);
        let _ = receiver.hear(&[byte]);
        let mut answer = None;
        while let Some(packet) = receiver.next_packet() {
            answer = self.take(&packet, heard.at).or(answer);
        }
        // A reboot has emptied it.
        if heard.at >= self.deaf_until {
            self.receiver = receiver;
        }
        answer.and_then(|answer| self.spoil(answer))
    }

    /// The line has been quiet: a packet that was not finished never will be.
    pub fn line_is_quiet(&mut self) {
        self.receiver.line_is_quiet();
    }

    /// A byte of the combined answer before this servo's own part.
    fn hear_chain(&mut self, byte: u8, at: Nanoseconds) -> Option<Answer> {
        let baud = self.baud();
        let Some(Turn { error, data, id, kind: TurnKind::Fast { lengths, place, before, expected } }) = &mut self.turn
        else {
            return None;
        };
        before.push(byte);
        if before.len() < *expected {
            return None;
        }
        let part = FastPart { lengths, place: *place, before, id: *id, error: *error, data };
        let bytes = part.encode().ok()?.to_vec();
        self.turn = None;
        self.spoil(Answer { at, bytes, baud })
    }

    fn take(&mut self, packet: &Packet<'_>, at: Nanoseconds) -> Option<Answer> {
        let instruction = match Instruction::of(packet) {
            Err(Malformed::IsStatus) => return self.hear_status(packet, at),
            other => other,
        };
        if ServoFaults::use_up(&mut self.faults.lost_instructions) {
            return None;
        }
        self.heard_at = at;
        self.turn = None;
        self.refresh(at);
        let own = self.id()?;
        if !packet.is_for(own) {
            let shadow = self.registers.get(&table::SECONDARY_ID) == i64::from(packet.id.get());
            if let (true, Ok(Instruction::Write { address, data })) = (shadow, instruction) {
                let _ = self.write(address, data);
            }
            return None;
        }
        let alone = packet.id != Id::BROADCAST;
        match instruction {
            Ok(instruction) => self.obey(instruction, alone, at),
            Err(Malformed::Unknown(_)) => self.reply(alone, StatusError::Instruction, at),
            Err(_) => self.reply(alone, StatusError::DataLength, at),
        }
    }

    /// Another servo has answered: it may be this one's turn.
    fn hear_status(&mut self, packet: &Packet<'_>, at: Nanoseconds) -> Option<Answer> {
        match &self.turn {
            Some(Turn { kind: TurnKind::After(before), .. }) if *before == packet.id.get() => {
                let turn = self.turn.take()?;
                self.answer(turn.error, &turn.data, at)
            }
            _ => None,
        }
    }

    fn obey(&mut self, instruction: Instruction<'_>, alone: bool, at: Nanoseconds) -> Option<Answer> {
        let level = self.registers.get(&table::STATUS_RETURN_LEVEL);
        let speaks = alone && level >= 2;
        match instruction {
            Instruction::Ping => self.ping(alone, at),
            Instruction::Read { address, length } if alone && level >= 1 => {
                let (error, data) = self.read(address, length);
                self.answer(error, &data, at)
            }
            Instruction::Read { .. } => None,
            Instruction::Write { address, data } => {
                // The answer still has the number and the speed of the question.
                let mut answer = self.answer(0, &[], at);
                if let Err(error) = self.write(address, data) {
                    answer = self.answer(error.number(), &[], at);
                }
                answer.filter(|_| speaks)
            }
            Instruction::RegWrite { address, data } => {
                let judged = self.registers.clone().write(address, data);
                if judged.is_ok() {
                    self.registered = Some((address, data.to_vec()));
                }
                self.reply_result(speaks, judged, at)
            }
            Instruction::Action => {
                let done = match self.registered.take() {
                    Some((address, data)) => self.write(address, &data),
                    None => Err(StatusError::Instruction),
                };
                self.reply_result(speaks, done, at)
            }
            Instruction::FactoryReset(scope) => self.factory_reset(scope, speaks, alone, at),
            Instruction::Reboot => {
                let answer = self.answer(0, &[], at).filter(|_| speaks);
                self.reboot(at);
                answer
            }
            Instruction::ClearTurns => {
                let stands = self.registers.get(&table::MOVING) == 0;
                if stands {
                    self.forget_turns();
                    self.loops.start(self.shown().position);
                }
                self.reply_result(speaks, if stands { Ok(()) } else { Err(StatusError::ResultFail) }, at)
            }
            Instruction::SyncWrite { address, .. } => {
                let own = self.id()?.get();
                for item in instruction.sync_items().filter(|item| item.id == own) {
                    let _ = self.write(address, item.data);
                }
                None
            }
            Instruction::BulkWrite { .. } => {
                let own = self.id()?.get();
                for item in instruction.bulk_writes().filter(|item| item.id == own) {
                    let _ = self.write(item.address, item.data);
                }
                None
            }
            Instruction::SyncRead { address, length, ids, fast } if level >= 1 => {
                let asked: Vec<_> = ids.iter().map(|&id| (id, address, length)).collect();
                self.take_turn(&asked, fast, at)
            }
            Instruction::BulkRead { fast, .. } if level >= 1 => {
                let asked: Vec<_> = instruction.bulk_reads().map(|item| (item.id, item.address, item.length)).collect();
                self.take_turn(&asked, fast, at)
            }
            Instruction::SyncRead { .. } | Instruction::BulkRead { .. } => None,
        }
    }

    fn ping(&self, alone: bool, at: Nanoseconds) -> Option<Answer> {
        let [low, high] = self.model.number.to_le_bytes();
        let mut answer = self.answer(0, &[low, high, self.model.firmware], at)?;
        if !alone {
            // Assumed: each number has a slot of an answer and its delay.
            let slot = Nanoseconds::of_bytes(PING_ANSWER, answer.baud).plus(self.return_delay());
            answer.at = answer.at.plus(Nanoseconds(slot.0.saturating_mul(u64::from(self.id()?.get()))));
        }
        Some(answer)
    }

    fn factory_reset(&mut self, scope: ResetScope, speaks: bool, alone: bool, at: Nanoseconds) -> Option<Answer> {
        if !alone && scope == ResetScope::All {
            return None;
        }
        let answer = self.answer(0, &[], at).filter(|_| speaks);
        let fresh = Registers::new(&self.model);
        let kept: &[_] = match scope {
            ResetScope::All => &[],
            ResetScope::ExceptId => &[table::ID],
            ResetScope::ExceptIdAndBaud => &[table::ID, table::BAUD_RATE],
        };
        let old = std::mem::replace(&mut self.registers, fresh);
        kept.iter().for_each(|register| self.registers.set(register, old.get(register)));
        self.reboot(at);
        answer
    }

    /// Finds this servo among those asked, and answers if it is the first.
    fn take_turn(&mut self, asked: &[(u8, u16, u16)], fast: bool, at: Nanoseconds) -> Option<Answer> {
        let id = self.id()?;
        let place = asked.iter().position(|(asked, ..)| *asked == id.get())?;
        let &(_, address, length) = asked.get(place)?;
        let (error, mut data) = self.read(address, length);
        if !fast {
            let Some((before, ..)) = place.checked_sub(1).and_then(|before| asked.get(before)) else {
                return self.answer(error, &data, at);
            };
            self.turn = Some(Turn { error, data, id, kind: TurnKind::After(*before) });
            return None;
        }
        if self.model.firmware < 45 {
            return None;
        }
        data.resize(usize::from(length), 0);
        let lengths: Vec<u16> = asked.iter().map(|(.., length)| *length).collect();
        if place == 0 {
            let part =
                FastPart { lengths: &lengths, place, before: &[], id, error: self.with_alert(error), data: &data };
            let bytes = part.encode().ok()?.to_vec();
            return Some(Answer { at: at.plus(self.return_delay()), bytes, baud: self.baud() });
        }
        let blocks: usize = lengths.iter().take(place).map(|length| usize::from(*length) + AROUND_DATA).sum();
        let kind = TurnKind::Fast { lengths, place, before: Vec::new(), expected: HEADER_BYTES + blocks };
        self.turn = Some(Turn { error: self.with_alert(error), data, id, kind });
        None
    }

    fn read(&self, address: u16, length: u16) -> (u8, Vec<u8>) {
        match self.registers.read(address, length) {
            Ok(data) => (0, data),
            Err(error) => (error.number(), Vec::new()),
        }
    }

    /// Carries out a write and what follows from it.
    fn write(&mut self, address: u16, data: &[u8]) -> Result<(), StatusError> {
        let had_torque = self.has_torque();
        let mode = self.registers.get(&table::OPERATING_MODE);
        let had_bitten = self.registers.has_bitten();
        let before = self.registers.clone();
        self.registers.write(address, data)?;
        if self.has_torque() && self.is_shut_down() {
            self.registers = before;
            return Err(StatusError::ResultFail);
        }
        if self.registers.get(&table::OPERATING_MODE) != mode {
            self.forget_turns();
            self.reset_goals();
        }
        if self.has_torque() && !had_torque {
            let goes_by_position = [3, 4, 5].contains(&self.registers.get(&table::OPERATING_MODE));
            let here = self.shown().position;
            self.loops.start(here);
            if goes_by_position {
                // It holds where it stands until a new goal comes.
                self.registers.set(&table::GOAL_POSITION, here as i64);
            }
        }
        if !self.has_torque() {
            self.drive = Drive::Open;
        }
        if had_bitten && !self.registers.has_bitten() {
            let here = self.shown().position;
            self.loops.start(here);
            self.registers.set(&table::GOAL_POSITION, here as i64);
        }
        self.refresh(self.heard_at);
        Ok(())
    }

    /// The goals of another mode begin at its limits, and the velocity at zero.
    fn reset_goals(&mut self) {
        self.registers.set(&table::GOAL_CURRENT, self.registers.get(&table::CURRENT_LIMIT));
        self.registers.set(&table::GOAL_PWM, self.registers.get(&table::PWM_LIMIT));
        self.registers.set(&table::GOAL_VELOCITY, 0);
    }

    fn reply_result(&self, speaks: bool, result: Result<(), StatusError>, at: Nanoseconds) -> Option<Answer> {
        self.answer(result.err().map_or(0, StatusError::number), &[], at).filter(|_| speaks)
    }

    fn reply(&self, alone: bool, error: StatusError, at: Nanoseconds) -> Option<Answer> {
        let speaks = alone && self.registers.get(&table::STATUS_RETURN_LEVEL) >= 2;
        self.reply_result(speaks, Err(error), at)
    }

    fn answer(&self, error: u8, data: &[u8], at: Nanoseconds) -> Option<Answer> {
        let bytes = answer::status(self.id()?, self.with_alert(error), data).ok()?.to_vec();
        Some(Answer { at: at.plus(self.return_delay()), bytes, baud: self.baud() })
    }

    fn with_alert(&self, error: u8) -> u8 {
        error | if self.errors.is_empty() { 0 } else { 0x80 }
    }

    /// What the injected faults leave of an answer.
    fn spoil(&mut self, mut answer: Answer) -> Option<Answer> {
        if ServoFaults::use_up(&mut self.faults.lost_answers) {
            return None;
        }
        if ServoFaults::use_up(&mut self.faults.wrong_ids) {
            answer.bytes = with_next_id(&answer.bytes);
        }
        if ServoFaults::use_up(&mut self.faults.flipped_answers)
            && let Some(byte) = answer.bytes.last_mut()
        {
            *byte ^= 0x10;
        }
        Some(answer)
    }
}

/// The packet with another number and the CRC that fits it.
fn with_next_id(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some(id) = bytes.get_mut(4) {
        *id = id.wrapping_add(1) % (Id::MAX + 1);
    }
    let end = bytes.len().saturating_sub(2);
    bytes.truncate(end);
    let crc = vergence_dynamixel::crc16(0, &bytes);
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}
