//! What the board reports and answers.

use vergence_protocol::management::ManagementReport;
use vergence_protocol::{AxisMask, HostEvent, Microseconds, MovePhase, Refusal, Report, Status, Ticket};

use super::{Host, HostEnd, MEND_US, MOST_FAULTS, PAUSE_US, Purpose, Seen};
use crate::scenario::Step;
use crate::stages::stages;

impl Host {
    pub(super) fn receive_event(&mut self, now: Microseconds, event: HostEvent) {
        if self.end.is_some() {
            return;
        }
        self.last_report_at = now;
        match event {
            HostEvent::Lost { boot } => {
                self.notes.push(format!("host: the session is lost, boot {boot}"));
                self.connect(now);
            }
            HostEvent::Reply { ticket, report: Report::Ack { status, .. } } => self.answered(now, ticket, status),
            HostEvent::Report(Report::Pose(pose)) => {
                self.seen = Some(Seen {
                    state: pose.state,
                    referenced: pose.referenced == AxisMask::first(stages().len()),
                    settled: (pose.phase == MovePhase::Settled).then_some(pose.move_id),
                    fault: pose.fault,
                });
            }
            HostEvent::Management(ManagementReport::Identity(identity)) => self.identity = Some(identity),
            HostEvent::Opened { .. } | HostEvent::Reply { .. } | HostEvent::Report(_) => {}
            HostEvent::Log(_) | HostEvent::Management(_) => {}
        }
    }

    fn answered(&mut self, now: Microseconds, ticket: Ticket, status: Status) {
        let Some(asked) = self.asked.take_if(|asked| asked.ticket == ticket) else { return };
        // Wait for a pose that is newer than the answer.
        self.seen = None;
        if let Status::Refused(why) = status {
            self.notes.push(format!("host: refused: {why}"));
            self.wait_until = Microseconds(now.0 + PAUSE_US);
        }
        match (asked.purpose, status) {
            (Purpose::Stream, _) => self.streaming = status == Status::Accepted,
            (Purpose::Home, _) => self.homed = status == Status::Accepted,
            (Purpose::Move(id), Status::Accepted) => {
                self.going = Some(id);
                match self.script.get(self.step) {
                    Some(Step::MoveAndStop(_, us)) => self.stop_due = Some(Microseconds(now.0 + us)),
                    Some(Step::Retarget(_, us, _)) => self.turn_due = Some(Microseconds(now.0 + us)),
                    _ => {}
                }
            }
            (Purpose::Turn(id), Status::Accepted) => (self.going, self.turned) = (Some(id), true),
            (Purpose::Jog(id), Status::Accepted) => self.going = Some(id),
            (Purpose::Jog(_), Status::Refused(Refusal::OutsideLimits { .. } | Refusal::AtHardLimit { .. })) => {
                self.next_step();
            }
            (Purpose::Errand, Status::Accepted) => self.next_step(),
            (Purpose::Set, Status::Accepted) => self.unsaved = true,
            (Purpose::Forbidden | Purpose::WrongClear, Status::Accepted) => self.finish(HostEnd::ForbiddenAccepted),
            (Purpose::WrongClear, Status::Refused(_)) => self.wait_until = Microseconds(now.0 + MEND_US),
            (Purpose::Forbidden, Status::Refused(_)) => self.next_step(),
            (Purpose::Clear, Status::Accepted) => {
                self.mending = None;
                self.faults += 1;
                if self.faults > MOST_FAULTS {
                    self.give_up("too many faults");
                }
            }
            _ => {}
        }
    }
}
