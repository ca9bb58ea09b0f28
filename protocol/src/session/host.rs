//! The host's end of one session.

mod receive;

use heapless::{Deque, Vec};

use super::board::LOG_CHUNK;
use super::line::Line;
use super::retransmission::{WINDOW, Window, sequence};
use super::round_trip::Repeat;
use super::statistics::HostStatistics;
use crate::frame::{Header, Kind, MAX_FRAME};
use crate::management::{Management, ManagementReport};
use crate::receiver::Receiver;
use crate::{Microseconds, PROTOCOL, ProtocolVersion, Report, Request, SessionId, schema_hash};

/// Number of immediate requests that may wait for the line.
const IMMEDIATE: usize = 4;
/// Number of management requests that may wait for the line.
const MANAGEMENT: usize = WINDOW;

/// Names one request of a session, so that its answer can be recognised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket {
    immediate: bool,
    number: u32,
}

/// Degree to which host and board understand each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compatibility {
    /// The schemas are equal: all requests are possible.
    Full,
    /// The schemas differ: the board may be read and stopped but not moved.
    ReadOnly,
    /// The major versions differ: only `GetInfo` by [`HostSession::send_now`] and [`HostSession::manage`] are possible.
    Incompatible {
        /// Protocol version of the board.
        board: ProtocolVersion,
    },
}

/// Event that received bytes cause on the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostEvent {
    /// The board answered [`HostSession::hello`].
    Opened {
        /// Degree to which host and board understand each other.
        compatibility: Compatibility,
        /// Number that changes with every start of the board.
        boot: u32,
    },
    /// The board no longer knows this session: it restarted, or another host opened a session. Unanswered requests stay
    /// unanswered. Make a new `HostSession` with a new id.
    Lost {
        /// Number that changes with every start of the board.
        boot: u32,
    },
    /// The answer to a request: a report that names one ([`Report::to`]).
    Reply {
        /// The request that is answered.
        ticket: Ticket,
        /// The answer.
        report: Report,
    },
    /// A report that answers no request: `Pose`, `MoveState`, `Fault`, `TimeReply` or `TriggerMark`.
    Report(Report),
    /// The next bytes of the board's log. An entry may be spread over several frames, and frames between may be lost.
    Log(Vec<u8, LOG_CHUNK>),
    /// The answer to a management request, with or without a session. It may come twice.
    Management(ManagementReport),
}

/// Why a request was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// The board has not answered `Hello`, is incompatible, or has lost the session.
    #[error("there is no open session with the board")]
    NotOpen,
    /// [`crate::WINDOW`] requests await an answer: try again after the next reply.
    #[error("too many requests await an answer: try again after the next one")]
    WindowFull,
    /// Too many requests wait for the line: call `transmit`.
    #[error("too many requests wait for the serial line")]
    QueueFull,
    /// The request must be sent by another function: `hello`, `submit` or `send_now`.
    #[error("this request must be sent by another function of the session")]
    WrongWay,
}

/// Phase of the session.
#[derive(Clone, Copy, Debug)]
enum Phase {
    Closed,
    Opening(Repeat),
    Open { boot: u32 },
    Incompatible,
}

/// The host's end of one session; [`crate::BoardSession`] is the other end and shows both in an example.
///
/// Loop: give received bytes to [`receive`](Self::receive), call [`transmit`](Self::transmit) until it returns `None`, wait
/// for bytes or until [`next_wake`](Self::next_wake).
#[derive(Debug)]
pub struct HostSession {
    id: SessionId,
    phase: Phase,
    receiver: Receiver,
    line: Line,
    window: Window,
    immediate: Deque<(u32, Request), IMMEDIATE>,
    immediate_next: u32,
    management: Deque<(u8, Management), MANAGEMENT>,
    management_next: u8,
    /// Number of the last frame from the board.
    received_seq: u8,
    last_received_at: Option<Microseconds>,
    pose_seq: Option<u16>,
    poses: u32,
    poses_lost: u32,
}

impl HostSession {
    /// A closed session. `id` must be random and not zero: the board takes equal ids for the same session.
    #[must_use]
    pub fn new(id: SessionId) -> Self {
        Self {
            id,
            phase: Phase::Closed,
            receiver: Receiver::new(),
            line: Line::default(),
            window: Window::new(),
            immediate: Deque::new(),
            immediate_next: 0,
            management: Deque::new(),
            management_next: 0,
            received_seq: 0,
            last_received_at: None,
            pose_seq: None,
            poses: 0,
            poses_lost: 0,
        }
    }

    /// Sends `Hello` repeatedly until the board answers and [`HostEvent::Opened`] comes. Ignored on a session that was
    /// opened before.
    pub fn hello(&mut self) {
        if matches!(self.phase, Phase::Closed) && self.last_received_at.is_none() {
            self.phase = Phase::Opening(Repeat::new());
        }
    }

    /// Submits a request that the board carries out once and in order; its answer comes as [`HostEvent::Reply`].
    ///
    /// # Errors
    /// [`SubmitError`] if the request was not taken.
    pub fn submit(&mut self, now: Microseconds, request: Request) -> Result<Ticket, SubmitError> {
        match request {
            Request::Hello { .. } | Request::Heartbeat { .. } | Request::TimeProbe { .. } | Request::Stop { .. } => {
                return Err(SubmitError::WrongWay);
            }
            _ if !self.is_open() => return Err(SubmitError::NotOpen),
            _ => {}
        }
        let number = self.window.submit(now, request).ok_or(SubmitError::WindowFull)?;
        Ok(Ticket { immediate: false, number })
    }

    /// Sends `Heartbeat`, `TimeProbe`, `Stop` or `GetInfo` once, before all submitted requests; the caller repeats it if
    /// necessary. A `Stop` goes before all others and needs no open session, but its answer arrives only on an open one.
    /// The `t0` of a `TimeProbe` is set when it leaves.
    ///
    /// # Errors
    /// [`SubmitError`] if the request was not taken. A `Stop` is always taken.
    pub fn send_now(&mut self, request: Request) -> Result<Ticket, SubmitError> {
        let number = self.immediate_next;
        let ticket = Ticket { immediate: true, number };
        match (&request, self.phase) {
            (request, _) if !super::may_bypass(request) => return Err(SubmitError::WrongWay),
            (Request::Stop { .. }, _) => {
                if self.immediate.is_full() {
                    self.immediate.pop_back();
                }
                self.immediate.push_front((number, request)).map_err(|_| SubmitError::QueueFull)?;
            }
            (_, Phase::Open { .. }) | (Request::GetInfo, Phase::Incompatible) => {
                self.immediate.push_back((number, request)).map_err(|_| SubmitError::QueueFull)?;
            }
            _ => return Err(SubmitError::NotOpen),
        }
        self.immediate_next = number.wrapping_add(1);
        Ok(ticket)
    }

    /// Sends a management request once, to a board of any major version, with or without a session; the caller repeats it
    /// if necessary. Returns its sequence number, which the answer names.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`] if the request was not taken.
    pub fn manage(&mut self, request: Management) -> Result<u8, SubmitError> {
        let seq = self.management_next;
        self.management.push_back((seq, request)).map_err(|_| SubmitError::QueueFull)?;
        self.management_next = seq.wrapping_add(1);
        Ok(seq)
    }

    /// Takes bytes from the board, which arrived at `now`, and gives `on_event` the events that they cause. Any bytes may come.
    pub fn receive(&mut self, now: Microseconds, bytes: &[u8], mut on_event: impl FnMut(HostEvent)) {
        for &byte in bytes {
            if let Some(event) = self.receive_byte(now, byte) {
                on_event(event);
            }
        }
    }

    /// Writes the next frame to send at `now` and returns its length in bytes, or `None` if none waits. Call it until then.
    pub fn transmit(&mut self, now: Microseconds, buffer: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let header = |kind, seq, ack| Header { major: PROTOCOL.major, kind, seq, ack };
        if let Some((kind, seq, request)) = self.next_request(now) {
            return self.line.write(now, header(kind, seq, self.received_seq), &request, buffer);
        }
        let (seq, request) = self.management.pop_front()?;
        self.line.write(now, header(Kind::Firmware, seq, self.received_seq), &request, buffer)
    }

    /// Time at which [`transmit`](Self::transmit) next has a frame if no bytes arrive before; zero means at once.
    #[must_use]
    pub fn next_wake(&self) -> Option<Microseconds> {
        match self.phase {
            _ if !self.immediate.is_empty() || !self.management.is_empty() => Some(Microseconds(0)),
            Phase::Opening(repeat) => Some(repeat.due()),
            Phase::Closed | Phase::Open { .. } | Phase::Incompatible => self.window.wake(),
        }
    }

    /// Whether requests may be submitted.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        matches!(self.phase, Phase::Open { .. })
    }

    /// Id of the session.
    #[must_use]
    pub const fn id(&self) -> SessionId {
        self.id
    }

    /// Number of submitted requests without an answer.
    #[must_use]
    pub fn unanswered(&self) -> usize {
        self.window.len()
    }

    /// Time at which the last frame from the board arrived since the session opened: a `now` of
    /// [`receive`](Self::receive).
    #[must_use]
    pub const fn last_received_at(&self) -> Option<Microseconds> {
        self.last_received_at
    }

    /// Figures of this session so far.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        HostStatistics {
            sent: self.line.sent(),
            retransmitted: self.window.retransmitted(),
            round_trip: self.window.round_trip().smoothed(),
            timeout: Microseconds(self.window.round_trip().timeout()),
            poses: self.poses,
            poses_lost: self.poses_lost,
            link: self.receiver.counters(),
        }
    }

    fn next_request(&mut self, now: Microseconds) -> Option<(Kind, u8, Request)> {
        if let Some((number, mut request)) = self.immediate.pop_front() {
            if let Request::TimeProbe { t0 } = &mut request {
                *t0 = now;
            }
            return Some((Kind::Immediate, sequence(number), request));
        }
        if let Phase::Opening(repeat) = &mut self.phase {
            if repeat.due() > now {
                return None;
            }
            repeat.sent(now);
            let hello = Request::Hello { protocol: PROTOCOL, schema: schema_hash(), session: self.id };
            return Some((Kind::Immediate, 0, hello));
        }
        let (seq, request) = self.window.transmit(now)?;
        Some((Kind::Control, seq, request))
    }
}
