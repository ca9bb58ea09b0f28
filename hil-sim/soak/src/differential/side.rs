//! What one board has said and done, and was not compared yet.

use std::collections::VecDeque;

use vergence_protocol::frame::Kind;
use vergence_protocol::management::ManagementReport;
use vergence_protocol::{PoseReport, Receiver, Report};

/// A kind of message; those of one kind come in order on both boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Answers to requests in order.
    Answers,
    /// `Hello`, and answers to requests outside the order.
    Immediate,
    /// Phases of moves.
    Phases,
    /// Faults.
    Faults,
    /// Pulses of the camera trigger.
    Marks,
    /// Management.
    Management,
}

impl Stream {
    /// Every kind.
    pub const ALL: [Self; 6] =
        [Self::Answers, Self::Immediate, Self::Phases, Self::Faults, Self::Marks, Self::Management];
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Said {
    /// A report of the node.
    Report(Report),
    /// A report of the updater.
    Management(ManagementReport),
}

/// What one board has said and done.
#[derive(Debug, Default)]
pub struct Side {
    receiver: Receiver,
    /// Messages of each kind, with the time of the session in microseconds at which they were there.
    said: [VecDeque<(u64, Said)>; 6],
    /// How many of each kind were heard.
    counts: [u64; 6],
    /// Poses.
    pub poses: VecDeque<PoseReport>,
    /// Steps of each axis: time of the session in nanoseconds, and whether forward.
    pub steps: [VecDeque<(u64, bool)>; 2],
    /// The latest messages but poses, as text.
    pub heard: VecDeque<(u64, String)>,
}

/// Messages kept as text.
const KEPT: usize = 12;

impl Side {
    /// Takes bytes that the board has sent.
    pub fn hear(&mut self, now_us: u64, bytes: &[u8]) {
        for &byte in bytes {
            let Some(frame) = self.receiver.push(byte) else { continue };
            let (kind, report) = (frame.header.kind, frame.body::<Report>());
            match (kind, report, frame.body::<ManagementReport>()) {
                (Kind::Firmware, _, Ok(report)) => self.keep(now_us, Stream::Management, Said::Management(report)),
                (Kind::Telemetry, Ok(Report::Pose(pose)), _) => self.poses.push_back(pose),
                (Kind::Control | Kind::Immediate, Ok(report), _) => {
                    let stream = match (kind, &report) {
                        (_, Report::MoveState { .. }) => Stream::Phases,
                        (_, Report::Fault(_)) => Stream::Faults,
                        (_, Report::TriggerMark(_)) => Stream::Marks,
                        (Kind::Immediate, _) => Stream::Immediate,
                        _ => Stream::Answers,
                    };
                    self.keep(now_us, stream, Said::Report(report));
                }
                _ => {}
            }
        }
    }

    fn keep(&mut self, now_us: u64, stream: Stream, said: Said) {
        self.heard.push_back((now_us, format!("{said:?}")));
        if self.heard.len() > KEPT {
            self.heard.pop_front();
        }
        self.said[stream as usize].push_back((now_us, said));
        self.counts[stream as usize] += 1;
    }

    /// How many messages of a kind were heard.
    pub fn count(&self, stream: Stream) -> u64 {
        self.counts[stream as usize]
    }

    /// The oldest message of a kind.
    pub fn first(&self, stream: Stream) -> Option<&(u64, Said)> {
        self.said[stream as usize].front()
    }

    /// Takes the oldest message of a kind.
    pub fn take(&mut self, stream: Stream) -> Option<(u64, Said)> {
        self.said[stream as usize].pop_front()
    }

    /// Forgets what was not compared, because the board restarts.
    pub fn forget(&mut self) {
        self.receiver = Receiver::new();
        self.said.iter_mut().for_each(VecDeque::clear);
        self.poses.clear();
        self.steps.iter_mut().for_each(VecDeque::clear);
    }
}
