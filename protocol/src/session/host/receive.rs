//! Frames that the host receives: answers, acknowledgements, and signs of a lost session.

use super::{Compatibility, HostEvent, HostSession, Phase, Ticket};
use crate::frame::{FrameError, Header, Kind};
use crate::session::retransmission::sequence;
use crate::{Microseconds, PROTOCOL, ProtocolVersion, Report, SessionId, schema_hash};

impl HostSession {
    pub(super) fn receive_byte(&mut self, now: Microseconds, byte: u8) -> Option<HostEvent> {
        let frame = self.receiver.push(byte)?;
        let header = frame.header;
        match header.kind {
            Kind::Control | Kind::Telemetry | Kind::Immediate => match frame.body() {
                Ok(report) => self.receive_report(now, header, report),
                Err(error) => self.reject(error),
            },
            Kind::AckOnly | Kind::Nak => {
                self.receive_header(now, header);
                None
            }
            Kind::Log => match frame.body() {
                Ok(bytes) => {
                    self.receive_header(now, header);
                    self.is_open().then_some(HostEvent::Log(bytes))
                }
                Err(error) => self.reject(error),
            },
            Kind::Firmware => match frame.body() {
                Ok(report) => {
                    self.receive_header(now, header);
                    Some(HostEvent::Management(report))
                }
                Err(error) => self.reject(error),
            },
        }
    }

    fn reject(&mut self, error: FrameError) -> Option<HostEvent> {
        self.receiver.reject(error);
        None
    }

    fn receive_report(&mut self, now: Microseconds, header: Header, report: Report) -> Option<HostEvent> {
        if let Report::Hello { protocol, schema, session, boot } = report {
            return self.receive_hello(now, (protocol, schema), session, boot);
        }
        self.receive_header(now, header);
        match (self.phase, header.major == PROTOCOL.major, &report) {
            (Phase::Open { .. }, true, _) | (Phase::Incompatible, _, Report::Info { .. }) => {}
            _ => return None,
        }
        if let Some(to) = report.to() {
            let ticket = self.answered(header.kind, to)?;
            return Some(HostEvent::Reply { ticket, report });
        }
        match report {
            Report::Pose(ref pose) => {
                self.count_pose(pose.seq);
                Some(HostEvent::Report(report))
            }
            _ => Some(HostEvent::Report(report)),
        }
    }

    /// Takes the acknowledgement in a header; it counts only in an open session with a board of the same major version.
    fn receive_header(&mut self, now: Microseconds, header: Header) {
        if header.major != PROTOCOL.major || !self.is_open() {
            return;
        }
        self.received_seq = header.seq;
        self.last_received_at = Some(now);
        self.window.acknowledge(now, header.ack);
        if header.kind == Kind::Nak {
            self.window.not_acknowledged(now, header.ack);
        }
    }

    fn receive_hello(
        &mut self,
        now: Microseconds,
        (protocol, schema): (ProtocolVersion, u64),
        session: SessionId,
        boot: u32,
    ) -> Option<HostEvent> {
        match self.phase {
            Phase::Opening(_) if session == self.id => {
                let compatibility = if protocol.major != PROTOCOL.major {
                    Compatibility::Incompatible { board: protocol }
                } else if schema != schema_hash() {
                    Compatibility::ReadOnly
                } else {
                    Compatibility::Full
                };
                self.last_received_at = Some(now);
                self.phase = match compatibility {
                    Compatibility::Incompatible { .. } => Phase::Incompatible,
                    Compatibility::Full | Compatibility::ReadOnly => Phase::Open { boot },
                };
                Some(HostEvent::Opened { compatibility, boot })
            }
            Phase::Open { boot: opened } if session != self.id || boot != opened => {
                self.phase = Phase::Closed;
                self.window.clear();
                Some(HostEvent::Lost { boot })
            }
            _ => None,
        }
    }

    fn answered(&mut self, kind: Kind, to: u8) -> Option<Ticket> {
        if kind == Kind::Immediate {
            let latest = self.immediate_next.checked_sub(1)?;
            let number = latest.checked_sub(u32::from(sequence(latest).wrapping_sub(to)))?;
            return Some(Ticket { immediate: true, number });
        }
        Some(Ticket { immediate: false, number: self.window.answer(to)? })
    }

    fn count_pose(&mut self, seq: u16) {
        if let Some(last) = self.pose_seq {
            let lost = seq.wrapping_sub(last).wrapping_sub(1);
            // More than half the range means a pose out of order or a restarted stream, not a loss.
            if lost < 1 << 15 {
                self.poses_lost = self.poses_lost.saturating_add(u32::from(lost));
            }
        }
        self.pose_seq = Some(seq);
        self.poses = self.poses.saturating_add(1);
    }
}
