//! What the board answered last, so that a request that comes again is answered again and not done again.

use heapless::Deque;

use crate::Report;

/// Twice the host's window.
const RESULTS: usize = 2 * super::WINDOW;

#[derive(Debug)]
struct Answer {
    seq: u8,
    report: Option<Report>,
    due: bool,
}

#[derive(Debug, Default)]
pub(super) struct Results {
    answers: Deque<Answer, RESULTS>,
}

impl Results {
    /// A request was delivered: an answer will come.
    pub(super) fn expect(&mut self, seq: u8) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // There is room now.
        let _ = self.answers.push_back(Answer { seq, report: None, due: false });
    }

    /// The answer came. It is kept if the request is remembered.
    pub(super) fn record(&mut self, seq: u8, report: Report) {
        if let Some(answer) = self.find(seq) {
            answer.report = Some(report);
            answer.due = true;
        }
    }

    /// The request came again: send its answer again, once there is one.
    pub(super) fn repeat(&mut self, seq: u8) {
        if let Some(answer) = self.find(seq) {
            answer.due = true;
        }
    }

    /// The next answer to send.
    pub(super) fn transmit(&mut self) -> Option<Report> {
        let answer = self.answers.iter_mut().find(|answer| answer.due && answer.report.is_some())?;
        answer.due = false;
        answer.report.clone()
    }

    pub(super) fn clear(&mut self) {
        self.answers.clear();
    }

    fn find(&mut self, seq: u8) -> Option<&mut Answer> {
        self.answers.iter_mut().rev().find(|answer| answer.seq == seq)
    }
}
