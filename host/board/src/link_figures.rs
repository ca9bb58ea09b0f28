//! Measures round trips over the link, beside the time that the bytes take on the wire.

use std::time::Duration;

use serde::Serialize;
use serde_json::{Value, json};
use tokio::time::{MissedTickBehavior, interval};
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{BoardStatistics, HostStatistics, MAX_FRAME, PROTOCOL, Report, Request, Status};
use vergence_rig::rounded;

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

/// What the link lost while it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the link lost {requests} requests and {poses} poses: check cable, baud rate and what else uses the processor")]
pub struct LinkLosses {
    /// Requests that were never answered.
    pub requests: u32,
    /// Poses that did not arrive.
    pub poses: u32,
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

    /// Whether nothing was lost.
    ///
    /// # Errors
    /// [`LinkLosses`], with what was.
    pub fn check(&self) -> Result<(), LinkLosses> {
        let (requests, poses) = (self.unanswered, self.host.poses_lost);
        if requests > 0 || poses > 0 { Err(LinkLosses { requests, poses }) } else { Ok(()) }
    }

    /// The figures as lines for people. The line has `baud` bits per second; where it `is_wire`, bytes take time on it.
    #[must_use]
    pub fn lines(&self, baud: u32, is_wire: bool) -> Vec<String> {
        let percentile = |share| self.percentile(share).unwrap_or(f64::NAN);
        let ([request, answer], host) = (self.bytes, &self.host);
        vec![
            format!(
                "requests    {} answered, {} unanswered, {} frames sent again",
                self.round_trips_ms.len(),
                self.unanswered,
                host.retransmitted
            ),
            format!(
                "round trip  median {:.3} ms, 95 % {:.3} ms, 99 % {:.3} ms, longest {:.3} ms",
                percentile(0.5),
                percentile(0.95),
                percentile(0.99),
                percentile(1.0)
            ),
            format!(
                "wire floor  {:.3} ms: {request} + {answer} bytes of 10 bits at {baud} baud{}",
                self.wire_floor_ms(baud),
                if is_wire { "" } else { "; this port is no wire, its bytes take no time" }
            ),
            format!("poses       {} received, {} lost", host.poses, host.poses_lost),
            format!("host received  {} frames, dropped {}", host.link.frames, host.link.dropped()),
            match &self.board {
                Some(board) => format!(
                    "board received {} frames, dropped {}, {} twice, {} after a gap; replaced {} poses unsent (since its start)",
                    board.link.frames,
                    board.link.dropped(),
                    board.duplicates,
                    board.gaps,
                    board.poses_replaced
                ),
                None => "board received unknown: this firmware keeps no counts".into(),
            },
        ]
    }

    /// The figures for programs, as those of [`Self::lines`].
    #[must_use]
    pub fn json(&self, baud: u32, is_wire: bool) -> Value {
        let percentile = |share| rounded(self.percentile(share).unwrap_or(f64::NAN));
        json!({
            "requests": self.round_trips_ms.len() + self.unanswered as usize,
            "unanswered": self.unanswered,
            "retransmitted": self.host.retransmitted,
            "round_trip_ms": {
                "median": percentile(0.5), "p95": percentile(0.95), "p99": percentile(0.99), "max": percentile(1.0),
            },
            "wire_floor_ms": rounded(self.wire_floor_ms(baud)),
            "is_wire": is_wire,
            "poses": self.host.poses,
            "poses_lost": self.host.poses_lost,
            "host": self.host.link,
            "board": self.board,
        })
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
