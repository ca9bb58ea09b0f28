//! The conversation between host and board, without input or output of its own: bytes and times go in, bytes come out.
//!
//! Requests that change something go through a window of four, numbered from 0 in each session, repeated until answered
//! and delivered once and in order (go-back-N). `Hello`, `Heartbeat`, `TimeProbe` and `Stop` pass by the window: a late
//! one is worth nothing, and a stop must not queue. The board never repeats by itself: it answers again when asked
//! again, and all that matters is in every pose.

mod board;
mod host;
mod line;
mod results;
mod round_trip;
mod statistics;
mod window;

pub use board::{BoardEvent, BoardSession, LOG_CHUNK, ReplyTo};
pub use host::{Compatibility, HostEvent, HostSession, SubmitError, Ticket};
pub use statistics::{BoardStatistics, HostStatistics};
pub use window::WINDOW;

use crate::Request;

/// Whether a request may pass by the window. `GetInfo` may, so that a board of another major can be asked what it is.
const fn may_pass_by(request: &Request) -> bool {
    matches!(request, Request::Heartbeat { .. } | Request::TimeProbe { .. } | Request::Stop { .. } | Request::GetInfo)
}
