//! The board's end.

use heapless::{Deque, Vec};

use super::line::Line;
use super::results::Results;
use super::statistics::BoardStatistics;
use crate::frame::{FrameError, Header, Kind, MAX_FRAME};
use crate::management::{Management, ManagementReport};
use crate::receiver::{Receiver, increment};
use crate::{Microseconds, PROTOCOL, PoseReport, Refusal, Report, Request, SessionId, Status, schema_hash};

/// How many answers to immediate requests may wait for the line.
const IMMEDIATE: usize = 4;
/// How many answers to management requests may wait for the line.
const MANAGEMENT: usize = super::WINDOW;
/// How many events may wait for the line.
const EVENTS: usize = 8;
/// How many bytes of log may wait for the line.
const LOG: usize = 512;
/// The most bytes of log in one frame: short, because an answer may have to wait for it.
pub const LOG_CHUNK: usize = 48;

/// Which request an answer belongs to. Answers that outlive their session go nowhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplyTo {
    immediate: bool,
    seq: u8,
    session: Option<SessionId>,
}

/// What the board hears.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BoardEvent {
    /// A new session began; what the last one asked for (the telemetry stream) is over.
    Opened {
        /// Its id.
        session: SessionId,
    },
    /// A request: once and in order, or at once for `Heartbeat`, `TimeProbe`, `Stop` and an immediate `GetInfo`.
    Request {
        /// Give this to [`BoardSession::reply`].
        reply_to: ReplyTo,
        /// What is asked.
        request: Request,
        /// When its last byte arrived, by the `now` of [`BoardSession::receive`].
        received_at: Microseconds,
    },
    /// A management request, from a host of any major, with or without a session. It may come twice.
    Management {
        /// Give this to [`BoardSession::reply_management`].
        seq: u8,
        /// What is asked.
        request: Management,
    },
}

#[derive(Clone, Copy, Debug)]
struct Open {
    session: SessionId,
    read_only: bool,
}

/// The board's end, for all sessions from start to power-off. Loop: for each byte [`receive`](Self::receive), and
/// [`reply`](Self::reply) to the request it gives; then [`transmit`](Self::transmit) until it gives nothing.
#[derive(Debug)]
pub struct BoardSession {
    boot: u32,
    open: Option<Open>,
    receiver: Receiver,
    line: Line,
    seq: u8,
    expected: u8,
    hello_due: Option<SessionId>,
    nak_due: bool,
    ack_due: bool,
    results: Results,
    immediate: Deque<Report, IMMEDIATE>,
    management: Deque<ManagementReport, MANAGEMENT>,
    events: Deque<Report, EVENTS>,
    pose: Option<PoseReport>,
    log: Deque<u8, LOG>,
    statistics: BoardStatistics,
}

impl BoardSession {
    /// No session yet. `boot` must change with every start of the board.
    #[must_use]
    pub fn new(boot: u32) -> Self {
        Self {
            boot,
            open: None,
            receiver: Receiver::new(),
            line: Line::default(),
            seq: 0,
            expected: 0,
            hello_due: None,
            nak_due: false,
            ack_due: false,
            results: Results::default(),
            immediate: Deque::new(),
            management: Deque::new(),
            events: Deque::new(),
            pose: None,
            log: Deque::new(),
            statistics: BoardStatistics::default(),
        }
    }

    /// Takes one byte from the host, any byte, that arrived `now`.
    pub fn receive(&mut self, now: Microseconds, byte: u8) -> Option<BoardEvent> {
        let frame = self.receiver.push(byte)?;
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

    /// Answers a request. The session fills in `to`, and `t2` when a `TimeReply` leaves; it remembers the answers to
    /// requests in order, to give them again. A `Heartbeat` may go unanswered.
    pub fn reply(&mut self, reply_to: ReplyTo, mut report: Report) {
        if reply_to.session != self.session() {
            return;
        }
        if let Some(to) = report.to_mut() {
            *to = reply_to.seq;
        }
        if reply_to.immediate {
            push_out(&mut self.immediate, report, &mut self.statistics.replies_dropped);
        } else {
            self.results.record(reply_to.seq, report);
        }
    }

    /// Answers management request `seq`; the session fills in `to`.
    pub fn reply_management(&mut self, seq: u8, mut report: ManagementReport) {
        if let ManagementReport::Progress { to, .. } = &mut report {
            *to = seq;
        }
        push_out(&mut self.management, report, &mut self.statistics.replies_dropped);
    }

    /// Sends an event: `MoveState`, `Fault` or `FrameMark`. Nothing happens without a session; the oldest goes when too many wait.
    pub fn send(&mut self, report: Report) {
        if self.open.is_some() {
            push_out(&mut self.events, report, &mut self.statistics.events_dropped);
        }
    }

    /// Sends a pose when nothing else is to be sent, and only the latest. Nothing happens without a session.
    pub fn telemetry(&mut self, pose: PoseReport) {
        if self.open.is_some() && self.pose.replace(pose).is_some() {
            increment(&mut self.statistics.poses_replaced);
        }
    }

    /// Keeps one log entry, text or encoded, to be sent when there is nothing else to send; what is logged before a
    /// session waits for it. An entry that does not fit is dropped whole.
    pub fn log(&mut self, entry: &[u8]) {
        if entry.len() > LOG - self.log.len() {
            increment(&mut self.statistics.logs_dropped);
            return;
        }
        self.log.extend(entry.iter().copied());
    }

    /// Writes the next frame to send `now`, or `None` when there is none: answers first, then events, then the pose,
    /// then the log.
    pub fn transmit(&mut self, now: Microseconds, buffer: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let (kind, body) = self.next_frame(now)?;
        let header = Header { major: PROTOCOL.major, kind, seq: self.seq, ack: self.expected.wrapping_sub(1) };
        self.seq = self.seq.wrapping_add(1);
        self.ack_due = false;
        match body {
            Body::Report(report) => self.line.write(now, header, &report, buffer),
            Body::Management(report) => self.line.write(now, header, &report, buffer),
            Body::Log(bytes) => self.line.write(now, header, &bytes, buffer),
            Body::None => self.line.write(now, header, &(), buffer),
        }
    }

    /// The open session.
    #[must_use]
    pub fn session(&self) -> Option<SessionId> {
        self.open.map(|open| open.session)
    }

    /// Figures so far.
    #[must_use]
    pub fn statistics(&self) -> BoardStatistics {
        BoardStatistics { sent: self.line.sent(), link: self.receiver.counters(), ..self.statistics }
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

    /// Of another major only what is frozen for ever is understood, and it opens nothing.
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
            Ok(request) if super::may_pass_by(&request) => {
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
            // Left unanswered it would be repeated for ever.
            Err(error) => {
                self.receiver.reject(error);
                Refusal::Invalid
            }
        };
        self.results.record(header.seq, Report::Ack { to: header.seq, status: Status::Refused(refusal) });
        None
    }

    fn receive_hello(&mut self, open: Open) -> Option<BoardEvent> {
        // Zero means "none": nobody can open it.
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

    /// A host that does not know of the board's restart learns it from a `Hello` of no session.
    fn refuse_without_session(&mut self) -> Option<BoardEvent> {
        increment(&mut self.statistics.without_session);
        self.hello_due.get_or_insert_default();
        None
    }

    fn deliver(&mut self, received_at: Microseconds, immediate: bool, seq: u8, request: Request) -> BoardEvent {
        let reply_to = ReplyTo { immediate, seq, session: self.session() };
        BoardEvent::Request { reply_to, request, received_at }
    }

    fn next_frame(&mut self, now: Microseconds) -> Option<(Kind, Body)> {
        if let Some(session) = self.hello_due.take() {
            let hello = Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session, boot: self.boot };
            return Some((Kind::Immediate, Body::Report(hello)));
        }
        if let Some(mut report) = self.immediate.pop_front() {
            if let Report::TimeReply { t2, .. } = &mut report {
                *t2 = now;
            }
            return Some((Kind::Immediate, Body::Report(report)));
        }
        if let Some(report) = self.management.pop_front() {
            return Some((Kind::Firmware, Body::Management(report)));
        }
        if core::mem::take(&mut self.nak_due) {
            return Some((Kind::Nak, Body::None));
        }
        if let Some(control) = self.results.transmit().or_else(|| self.events.pop_front()) {
            return Some((Kind::Control, Body::Report(control)));
        }
        if let Some(pose) = self.pose.take() {
            return Some((Kind::Telemetry, Body::Report(Report::Pose(pose))));
        }
        if self.ack_due {
            return Some((Kind::AckOnly, Body::None));
        }
        if self.open.is_none() || self.log.is_empty() {
            return None;
        }
        let chunk = core::iter::from_fn(|| self.log.pop_front()).take(LOG_CHUNK).collect();
        Some((Kind::Log, Body::Log(chunk)))
    }
}

/// What a frame carries.
enum Body {
    None,
    Report(Report),
    Management(ManagementReport),
    Log(Vec<u8, LOG_CHUNK>),
}

/// What a host of another schema may not ask.
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

/// Puts `report` last; where the queue is full the first goes and is counted.
fn push_out<T, const N: usize>(queue: &mut Deque<T, N>, report: T, dropped: &mut u32) {
    if queue.is_full() {
        queue.pop_front();
        increment(dropped);
    }
    // There is room now.
    let _ = queue.push_back(report);
}
