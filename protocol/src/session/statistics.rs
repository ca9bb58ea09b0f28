//! Figures of the link, as each end counts them.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::Microseconds;
use crate::receiver::LinkCounters;

/// The board's figures since it started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BoardStatistics {
    /// Frames sent.
    pub sent: u32,
    /// Repeated requests: answered again, not carried out again.
    pub duplicates: u32,
    /// Requests dropped because an earlier one was missing.
    pub gaps: u32,
    /// Requests dropped because no session was open.
    pub without_session: u32,
    /// Answers to immediate and management requests that later ones pushed out of the queue.
    pub replies_dropped: u32,
    /// Events that later ones pushed out of the queue.
    pub events_dropped: u32,
    /// Poses that were replaced by later ones before they were sent.
    pub poses_replaced: u32,
    /// Log entries dropped because the queue was full.
    pub logs_dropped: u32,
    /// Frames received and dropped.
    pub link: LinkCounters,
}

/// The host's figures of one session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostStatistics {
    /// Frames sent.
    pub sent: u32,
    /// Requests sent again.
    pub retransmitted: u32,
    /// Smoothed round-trip time; `None` before the first acknowledgement.
    pub round_trip: Option<Microseconds>,
    /// Time after which an unanswered request is sent again.
    pub timeout: Microseconds,
    /// Poses received.
    pub poses: u32,
    /// Poses that are missing in the board's numbering.
    pub poses_lost: u32,
    /// Frames received and dropped.
    pub link: LinkCounters,
}
