//! The board's end of the session: answers, events, poses and log go out by urgency.

mod receive;

use heapless::{Deque, Vec};

use super::line::Line;
use super::results::Results;
use super::statistics::BoardStatistics;
use crate::frame::{Header, Kind, MAX_FRAME};
use crate::management::{Management, ManagementReport};
use crate::receiver::{Receiver, increment};
use crate::{Microseconds, PROTOCOL, PoseReport, Report, Request, SessionId, schema_hash};

/// Number of answers to immediate requests that may wait for the line.
const IMMEDIATE: usize = 4;
/// Number of answers to management requests that may wait for the line.
const MANAGEMENT: usize = super::WINDOW;
/// Number of events that may wait for the line.
const EVENTS: usize = 8;
/// Number of log bytes that may wait for the line.
const LOG: usize = 512;
/// Largest number of log bytes in one frame: small, because an answer may have to wait for the frame.
pub const LOG_CHUNK: usize = 48;

/// Names the request that an answer belongs to. An answer to a request of an earlier session is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplyTo {
    immediate: bool,
    seq: u8,
    session: Option<SessionId>,
}

/// Event that received bytes cause on the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BoardEvent {
    /// A new session began; the pose stream that the last session asked for is over.
    Opened {
        /// Id of the new session.
        session: SessionId,
    },
    /// A request: delivered once and in order; `Heartbeat`, `TimeProbe`, `Stop` and an immediate `GetInfo` at once.
    Request {
        /// To be given to [`BoardSession::reply`].
        reply_to: ReplyTo,
        /// The request.
        request: Request,
        /// Arrival of the request's last byte: the `now` of [`BoardSession::receive`].
        received_at: Microseconds,
    },
    /// A management request, from a host of any major version, with or without a session. It may come twice.
    Management {
        /// To be given to [`BoardSession::reply_management`].
        seq: u8,
        /// The request.
        request: Management,
    },
}

/// The open session.
#[derive(Clone, Copy, Debug)]
struct Open {
    session: SessionId,
    /// The host has another schema: it may read but not move.
    read_only: bool,
}

/// The board's end of all sessions from start to power-off.
///
/// Loop: give each byte to [`receive`](Self::receive) and [`reply`](Self::reply) to the request that it returns; then
/// call [`transmit`](Self::transmit) until it returns `None`.
///
/// ```
/// use vergence_protocol::{BoardEvent, BoardSession, HostSession, MAX_FRAME, Microseconds, SessionId};
///
/// let (mut host, mut board) = (HostSession::new(SessionId(7)), BoardSession::new(1));
/// let mut frame = [0; MAX_FRAME];
/// host.hello();
/// let length = host.transmit(Microseconds(0), &mut frame).expect("the host says hello");
/// let events: Vec<_> = frame[..length].iter().filter_map(|&byte| board.receive(Microseconds(500), byte)).collect();
/// assert_eq!(events, [BoardEvent::Opened { session: SessionId(7) }]);
/// let length = board.transmit(Microseconds(600), &mut frame).expect("the board answers");
/// host.receive(Microseconds(900), &frame[..length], |_| {});
/// assert!(host.is_open());
/// ```
#[derive(Debug)]
pub struct BoardSession {
    boot: u32,
    open: Option<Open>,
    receiver: Receiver,
    heard: bool,
    line: Line,
    /// Number of the next frame.
    seq: u8,
    /// Number of the next request in order.
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
    /// A board without a session. `boot` must change with every start of the board.
    #[must_use]
    pub fn new(boot: u32) -> Self {
        Self {
            boot,
            open: None,
            receiver: Receiver::new(),
            heard: false,
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

    /// Answers a request. The session fills in `to`, and `t2` when a `TimeReply` leaves. It remembers the answers to
    /// requests in order, to repeat them. A `Heartbeat` needs no answer.
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

    /// Queues an event: `MoveState`, `Fault` or `TriggerMark`. Ignored without a session; when the queue is full, the
    /// oldest event is dropped.
    pub fn send(&mut self, report: Report) {
        if self.open.is_some() {
            push_out(&mut self.events, report, &mut self.statistics.events_dropped);
        }
    }

    /// Queues a pose, which replaces one that has not been sent yet. Ignored without a session.
    pub fn telemetry(&mut self, pose: PoseReport) {
        if self.open.is_some() && self.pose.replace(pose).is_some() {
            increment(&mut self.statistics.poses_replaced);
        }
    }

    /// Queues one log entry, text or encoded, to be sent when nothing else waits. Entries logged before a session wait for
    /// it. An entry that does not fit is dropped whole.
    pub fn log(&mut self, entry: &[u8]) {
        if entry.len() > LOG - self.log.len() {
            increment(&mut self.statistics.logs_dropped);
            return;
        }
        self.log.extend(entry.iter().copied());
    }

    /// Writes the next frame to send at `now` and returns its length in bytes, or `None` if none waits. Answers go first,
    /// then events, then the pose, then the log.
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

    /// Id of the open session, if any.
    #[must_use]
    pub fn session(&self) -> Option<SessionId> {
        self.open.map(|open| open.session)
    }

    /// Whether a whole frame has come since the last call, of whatever kind and with whatever body.
    pub fn take_heard(&mut self) -> bool {
        core::mem::take(&mut self.heard)
    }

    /// Figures since the board started.
    #[must_use]
    pub fn statistics(&self) -> BoardStatistics {
        BoardStatistics { sent: self.line.sent(), link: self.receiver.counters(), ..self.statistics }
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

/// Body of an outgoing frame.
enum Body {
    None,
    Report(Report),
    Management(ManagementReport),
    Log(Vec<u8, LOG_CHUNK>),
}

/// Appends `report`; if the queue is full, drops its first element and counts it in `dropped`.
fn push_out<T, const N: usize>(queue: &mut Deque<T, N>, report: T, dropped: &mut u32) {
    if queue.is_full() {
        queue.pop_front();
        increment(dropped);
    }
    // The queue has room now.
    let _ = queue.push_back(report);
}
