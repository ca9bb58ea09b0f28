//! Measures round trips over the link, beside the time that the bytes take on the wire.

use std::time::Duration;

use serde::Serialize;
use tokio::time::{MissedTickBehavior, interval};
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{BoardStatistics, HostStatistics, MAX_FRAME, PROTOCOL, Report, Request, Status};

use crate::board::Board;
use crate::error::BoardError;
use crate::link::LinkError;

/// Time between two requests, which leaves room for poses, clock probes and a slow bridge.
const PACE: Duration = Duration::from_millis(5);
/// Start, eight data bits, stop.
const BITS_PER_BYTE: f64 = 10.0;

/// Quality of the link while it was asked many requests.
#[derive(Debug)]
pub struct LinkFigures {
    /// Time from request to answer of each answered request, in milliseconds; sorted.
    pub round_trips_ms: Vec<f64>,
    /// Requests that were never answered, however often they were sent.
    pub unanswered: u32,
    /// Bytes of one request and of its answer.
    pub bytes: [usize; 2],
    /// The host's counts during the measurement.
    pub host: HostStatistics,
    /// The board's counts since it started; `None` where its firmware keeps none.
    pub board: Option<BoardStatistics>,
}

impl LinkFigures {
    /// Asks the board about its first axis again and again for `time`.
    ///
    /// # Errors
    /// [`BoardError`] where the link ended.
    pub async fn measure(board: &mut Board, time: Duration) -> Result<Self, BoardError> {
        let request = Request::GetAxis { axis: 0 };
        let before = board.client().statistics();
        let clock = board.client().clock();
        let end = clock.instant(clock.now()) + time;
        let mut pace = interval(PACE);
        pace.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let (mut round_trips_ms, mut unanswered, mut answer_bytes) = (Vec::new(), 0, 0);
        while pace.tick().await < end {
            let asked = tokio::time::Instant::now();
            match board.client().ask(request.clone()).await {
                Ok(report) => {
                    round_trips_ms.push(asked.elapsed().as_secs_f64() * 1e3);
                    answer_bytes = frame_bytes(&report);
                }
                Err(LinkError::Silent(_)) => unanswered += 1,
                Err(error) => return Err(error.into()),
            }
        }
        round_trips_ms.sort_by(f64::total_cmp);
        let host = since(board.client().statistics(), before);
        let bytes = [frame_bytes(&request), answer_bytes];
        Ok(Self { round_trips_ms, unanswered, bytes, host, board: board_statistics(board).await? })
    }

    /// The round trip that a `share` (0 to 1) of the requests did not exceed, in milliseconds; `None` where none was answered.
    #[must_use]
    pub fn percentile(&self, share: f64) -> Option<f64> {
        let last = self.round_trips_ms.len().checked_sub(1)?;
        self.round_trips_ms.get((share * last as f64).round() as usize).copied()
    }

    /// Time that the bytes of a request and its answer take on a wire of `baud` bits per second, in milliseconds.
    #[must_use]
    pub fn wire_floor_ms(&self, baud: u32) -> f64 {
        1e3 * BITS_PER_BYTE * self.bytes.iter().sum::<usize>() as f64 / f64::from(baud.max(1))
    }
}

async fn board_statistics(board: &Board) -> Result<Option<BoardStatistics>, BoardError> {
    match board.client().ask(Request::GetStatistics).await? {
        Report::Statistics { statistics, .. } => Ok(Some(statistics)),
        Report::Ack { status: Status::Refused(_), .. } => Ok(None),
        _ => Err(BoardError::OtherAnswer("a question about the link")),
    }
}

/// Differences of two readings of the counts.
fn since(now: HostStatistics, before: HostStatistics) -> HostStatistics {
    let mut link = now.link;
    for (now, before) in [
        (&mut link.frames, before.link.frames),
        (&mut link.too_long, before.link.too_long),
        (&mut link.too_short, before.link.too_short),
        (&mut link.stuffing, before.link.stuffing),
        (&mut link.checksum, before.link.checksum),
        (&mut link.kind, before.link.kind),
        (&mut link.body, before.link.body),
    ] {
        *now = now.saturating_sub(before);
    }
    HostStatistics {
        sent: now.sent.saturating_sub(before.sent),
        retransmitted: now.retransmitted.saturating_sub(before.retransmitted),
        poses: now.poses.saturating_sub(before.poses),
        poses_lost: now.poses_lost.saturating_sub(before.poses_lost),
        link,
        ..now
    }
}

/// Length of a frame on the wire in bytes, the closing zero included.
fn frame_bytes<B: Serialize>(body: &B) -> usize {
    let header = Header { major: PROTOCOL.major, kind: Kind::Control, seq: 1, ack: 1 };
    encode(header, body, &mut [0; MAX_FRAME]).unwrap_or(0)
}
