//! What follows from a packet that was heard.

use vergence_dynamixel::{FastBlocks, Id, Packet, Status, StatusError};
use vergence_protocol::{AxisList, AxisMask};

use super::Master;
use crate::joints::exchange::{Exchange, Question};
use crate::joints::fault::JointFault;
use crate::joints::joint::MOTION;
use crate::joints::set_up;

impl Master {
    /// Takes a packet as an answer to the question that waits; one that comes unasked is ignored.
    pub(super) fn take(&mut self, packet: &Packet<'_>) {
        let Some(mut exchange) = self.exchange else { return };
        if exchange.question == Question::Fast {
            self.take_combined(packet, &mut exchange);
        } else if let Ok(status) = Status::of(packet) {
            self.take_status(&status, &mut exchange);
        }
        self.exchange = Some(exchange);
    }

    fn take_combined(&mut self, packet: &Packet<'_>, exchange: &mut Exchange) {
        let asked = self.asked(Question::Fast);
        let expected: AxisList<(usize, (Id, u16))> = self
            .joints
            .iter()
            .enumerate()
            .filter(|(index, _)| asked.contains(*index))
            .map(|(index, joint)| (index, (joint.settings.id, MOTION.length)))
            .collect();
        let lengths: AxisList<(Id, u16)> = expected.iter().map(|(_, block)| *block).collect();
        let Ok(blocks) = FastBlocks::of(packet, &lengths) else { return };
        for ((index, _), block) in expected.iter().zip(blocks) {
            let Ok(block) = block else { return };
            let Some(joint) = self.joints.get_mut(*index) else { return };
            joint.alert |= block.alert && joint.fault.is_none();
            if block.error.is_none() && joint.take_motion(exchange.asked_at, block.data) {
                answered(exchange, *index);
            }
        }
    }

    fn take_status(&mut self, status: &Status<'_>, exchange: &mut Exchange) {
        let index = self.joints.iter().position(|joint| joint.settings.id == status.id);
        let Some(index) = index.filter(|index| exchange.awaited.contains(*index)) else {
            exchange.stranger = true;
            self.counters.wrong_ids = self.counters.wrong_ids.saturating_add(1);
            return;
        };
        let Some(joint) = self.joints.get_mut(index) else { return };
        joint.alert |= status.alert && joint.fault.is_none();
        if let Some(error) = status.error {
            // A question that reached the servo garbled is repeated as one that was not answered.
            exchange.refusal =
                Some(error).filter(|error| exchange.question.joint().is_some() && *error != StatusError::Crc);
            return;
        }
        let is_sound = match exchange.question {
            Question::Sync => joint.await_others(exchange.asked_at, status.data),
            Question::Fast | Question::Motion(_) => joint.take_motion(exchange.asked_at, status.data),
            Question::State(_) => joint.take_state(self.torque, status.data),
            Question::Health(_) => joint.take_health(status.data),
            Question::Reboot(_) => true,
            Question::Ping(_) => {
                joint.next_step(false);
                status.ping_info().is_some()
            }
            Question::Write(_) => {
                (joint.is_written, joint.differs) = (true, false);
                true
            }
            Question::Entry(_) => {
                self.take_entry(index, status.data);
                true
            }
        };
        if is_sound {
            answered(exchange, index);
        }
    }

    /// Goes on where the register is as it should be; where it is not although it was written, the joint cannot be used.
    fn take_entry(&mut self, index: usize, data: &[u8]) {
        let is_last = self.entry(index, 1).is_none();
        let Some(entry) = self.entry(index, 0) else { return };
        let Some(joint) = self.joints.get_mut(index) else { return };
        if set_up::has(entry, data) {
            joint.next_step(is_last);
        } else if joint.is_written {
            joint.fail(JointFault::Refused(None));
        } else {
            joint.differs = true;
        }
    }

    /// The register of a joint's step of the set-up, or of one that many steps later. Step 0 is the ping.
    pub(super) fn entry(&self, index: usize, later: u8) -> Option<set_up::Entry> {
        let joint = self.joints.get(index)?;
        let step = joint.step?.checked_sub(1)?.saturating_add(later);
        set_up::entry(step, &joint.settings, &self.settings)
    }
}

fn answered(exchange: &mut Exchange, index: usize) {
    exchange.awaited.0 &= !AxisMask::default().with(index).0;
}
