//! The board's last answers: a repeated request is answered again but not carried out again.

use heapless::Deque;

use crate::Report;

/// Number of answers kept: twice the host's window.
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
    /// Notes that request `seq` was delivered: its answer will come.
    pub(super) fn expect(&mut self, seq: u8) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        // There is room now.
        let _ = self.answers.push_back(Answer { seq, report: None, due: false });
    }

    /// Keeps the answer to request `seq`, if the request is still remembered.
    pub(super) fn record(&mut self, seq: u8, report: Report) {
        if let Some(answer) = self.find(seq) {
            answer.report = Some(report);
            answer.due = true;
        }
    }

    /// Notes that request `seq` came again: its answer is sent again, once there is one.
    pub(super) fn repeat(&mut self, seq: u8) {
        if let Some(answer) = self.find(seq) {
            answer.due = true;
        }
    }

    /// Takes the next answer to send.
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
