//! How the link has been, as each end sees it.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::Microseconds;
use crate::receiver::LinkCounters;

/// Figures since the board started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BoardStatistics {
    /// Frames sent.
    pub sent: u32,
    /// Requests that came again and were only answered again.
    pub duplicates: u32,
    /// Requests that came too early because one before them was lost.
    pub gaps: u32,
    /// Requests dropped because no session was open.
    pub without_session: u32,
    /// Answers to immediate and management requests that were pushed out by later ones.
    pub replies_dropped: u32,
    /// Events that were pushed out by later ones.
    pub events_dropped: u32,
    /// Poses that a later one replaced before they were sent.
    pub poses_replaced: u32,
    /// Log entries dropped because too much waited.
    pub logs_dropped: u32,
    /// What came in.
    pub link: LinkCounters,
}

/// Figures of one session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HostStatistics {
    /// Frames sent.
    pub sent: u32,
    /// Requests sent again.
    pub retransmitted: u32,
    /// Smoothed round trip, microseconds; `None` before the first acknowledgement.
    pub round_trip: Option<Microseconds>,
    /// How long an unanswered request waits before it is sent again, microseconds.
    pub timeout: Microseconds,
    /// Poses received.
    pub poses: u32,
    /// Poses that the board numbered but that did not arrive.
    pub poses_lost: u32,
    /// What came in.
    pub link: LinkCounters,
}
