//! Frames that the board receives: order, repetition, and what hosts of other versions may ask.

use super::{BoardEvent, BoardSession, Open, ReplyTo};
use crate::frame::{FrameError, Header, Kind};
use crate::management::Management;
use crate::receiver::increment;
use crate::{Microseconds, PROTOCOL, Refusal, Report, Request, SessionId, Status, schema_hash};

impl BoardSession {
    /// Takes the next byte from the host, which arrived at `now`. Any byte may come.
    pub fn receive(&mut self, now: Microseconds, byte: u8) -> Option<BoardEvent> {
        let frame = self.receiver.push(byte)?;
        self.heard = true;
        let header = frame.header;
        if header.kind == Kind::Firmware {
            let body = frame.body::<Management>();
            return self.receive_management(header, body);
        }
        let body = frame.body::<Request>();
        match header.kind {
            Kind::Immediate | Kind::Control if header.major != PROTOCOL.major => {
                self.receive_foreign(now, header, body)
            }
            Kind::Immediate => self.receive_immediate(now, header, body),
            Kind::Control => self.receive_sequenced(now, header, body),
            Kind::Telemetry | Kind::Log | Kind::Firmware | Kind::AckOnly | Kind::Nak => None,
        }
    }

    fn receive_management(&mut self, header: Header, body: Result<Management, FrameError>) -> Option<BoardEvent> {
        match body {
            Ok(request) => Some(BoardEvent::Management { seq: header.seq, request }),
            Err(error) => {
                self.receiver.reject(error);
                None
            }
        }
    }

    /// Handles a request of a host of another major version: only the frozen ones are understood, and none opens a session.
    fn receive_foreign(
        &mut self,
        now: Microseconds,
        header: Header,
        body: Result<Request, FrameError>,
    ) -> Option<BoardEvent> {
        match body {
            Ok(Request::Hello { session, .. }) => {
                self.hello_due = Some(session);
                None
            }
            Ok(request @ Request::GetInfo) => Some(self.deliver(now, true, header.seq, request)),
            _ => None,
        }
    }

    fn receive_immediate(
        &mut self,
        now: Microseconds,
        header: Header,
        body: Result<Request, FrameError>,
    ) -> Option<BoardEvent> {
        match body {
            Ok(Request::Hello { protocol, schema, session }) => {
                let read_only = protocol.major != PROTOCOL.major || schema != schema_hash();
                self.receive_hello(Open { session, read_only })
            }
            Ok(request) if crate::session::may_bypass(&request) => {
                let needs_session = !matches!(request, Request::Stop { .. });
                if needs_session && self.open.is_none() {
                    return self.refuse_without_session();
                }
                Some(self.deliver(now, true, header.seq, request))
            }
            _ => {
                self.receiver.reject(FrameError::Body);
                None
            }
        }
    }

    fn receive_sequenced(
        &mut self,
        now: Microseconds,
        header: Header,
        body: Result<Request, FrameError>,
    ) -> Option<BoardEvent> {
        let Some(open) = self.open else { return self.refuse_without_session() };
        match header.seq.wrapping_sub(self.expected) {
            0 => {}
            1..128 => {
                increment(&mut self.statistics.gaps);
                self.nak_due = true;
                return None;
            }
            128.. => {
                increment(&mut self.statistics.duplicates);
                self.results.repeat(header.seq);
                self.ack_due = true;
                return None;
            }
        }
        self.expected = self.expected.wrapping_add(1);
        self.nak_due = false;
        self.ack_due = true;
        self.results.expect(header.seq);
        let refusal = match body {
            Ok(request) if !(open.read_only && moves(&request)) => {
                return Some(self.deliver(now, false, header.seq, request));
            }
            Ok(_) => Refusal::ReadOnly,
            // Without an answer the host would repeat it for ever.
            Err(error) => {
                self.receiver.reject(error);
                Refusal::Invalid
            }
        };
        self.results.record(header.seq, Report::Ack { to: header.seq, status: Status::Refused(refusal) });
        None
    }

    fn receive_hello(&mut self, open: Open) -> Option<BoardEvent> {
        // Zero means "no session".
        if open.session == SessionId::default() {
            return None;
        }
        self.hello_due = Some(open.session);
        if self.session() == Some(open.session) {
            return None;
        }
        self.open = Some(open);
        self.expected = 0;
        self.nak_due = false;
        self.ack_due = false;
        self.results.clear();
        self.immediate.clear();
        self.events.clear();
        self.pose = None;
        Some(BoardEvent::Opened { session: open.session })
    }

    /// Drops a request that came without a session. A `Hello` without session tells the host that the board has restarted.
    fn refuse_without_session(&mut self) -> Option<BoardEvent> {
        increment(&mut self.statistics.without_session);
        self.hello_due.get_or_insert_default();
        None
    }

    fn deliver(&mut self, received_at: Microseconds, immediate: bool, seq: u8, request: Request) -> BoardEvent {
        let reply_to = ReplyTo { immediate, seq, session: self.session() };
        BoardEvent::Request { reply_to, request, received_at }
    }
}

/// Whether a host of another schema may not send this request.
const fn moves(request: &Request) -> bool {
    matches!(
        request,
        Request::Arm { .. }
            | Request::Home { .. }
            | Request::MoveTo(_)
            | Request::Jog(_)
            | Request::ClearFault { .. }
            | Request::SetSetting { .. }
            | Request::SaveSettings
            | Request::RestoreSettings
            | Request::SetTrigger(_)
    )
}
