//! The session between host and board as two state machines without input or output of their own: bytes and times go in,
//! bytes and events come out.
//!
//! Requests that change something go through a window of four. They are numbered from 0 in each session, repeated until
//! answered, and delivered once and in order (go-back-N). `Hello`, `Heartbeat`, `TimeProbe` and `Stop` bypass the window:
//! a late heartbeat is worth nothing, and a stop must not queue. The board never repeats an answer by itself: it answers
//! again when the host asks again, and every pose repeats all state that the host must not miss.

mod board;
mod host;
mod line;
mod results;
mod retransmission;
mod round_trip;
mod statistics;

pub use board::{BoardEvent, BoardSession, LOG_CHUNK, ReplyTo};
pub use host::{Compatibility, HostEvent, HostSession, SubmitError, Ticket};
pub use retransmission::WINDOW;
pub use statistics::{BoardStatistics, HostStatistics};

use crate::Request;

/// Whether a request may bypass the window. `GetInfo` may, so that a host can identify a board of another major version.
const fn may_bypass(request: &Request) -> bool {
    matches!(request, Request::Heartbeat { .. } | Request::TimeProbe { .. } | Request::Stop { .. } | Request::GetInfo)
}
