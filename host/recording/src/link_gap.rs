//! How long the link to the board was gone while a recording was made: encoder readings and pulses of that time are missing.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use vergence_board::BoardNews;
use vergence_protocol::Microseconds;

/// The time without a link so far. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct LinkGap(Arc<Mutex<Gap>>);

#[derive(Debug, Default)]
struct Gap {
    since: Option<Microseconds>,
    before: Duration,
}

impl Gap {
    fn until(&self, now: Microseconds) -> Duration {
        self.since.map_or(Duration::ZERO, |since| Duration::from_micros(now.0.saturating_sub(since.0)))
    }
}

impl LinkGap {
    /// Takes what the board said at `now`; returns a sentence for the recording where the link ended or came back.
    pub fn note(&self, now: Microseconds, news: &BoardNews) -> Option<String> {
        let mut gap = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match news {
            BoardNews::LinkEnded => {
                gap.since = Some(now);
                Some("the link to the board ended: encoder readings and pulses are missing from here on".to_owned())
            }
            BoardNews::LinkBack => {
                let this = gap.until(now);
                gap.before += this;
                gap.since = None;
                let seconds = this.as_secs_f64();
                Some(format!(
                    "the link to the board is back: encoder readings and pulses of {seconds:.1} s are missing"
                ))
            }
            _ => None,
        }
    }

    /// All time without a link until `now`.
    pub fn total(&self, now: Microseconds) -> Duration {
        let gap = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        gap.before + gap.until(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_add_up_and_the_last_one_may_be_open() {
        let (gap, at) = (LinkGap::default(), |seconds: u64| Microseconds(seconds * 1_000_000));
        assert_eq!(gap.note(at(1), &BoardNews::ProbeSent), None);
        assert!(gap.note(at(2), &BoardNews::LinkEnded).is_some());
        assert!(gap.note(at(5), &BoardNews::LinkBack).is_some_and(|said| said.contains("3.0 s")));
        assert_eq!(gap.total(at(9)), Duration::from_secs(3));
        assert!(gap.note(at(10), &BoardNews::LinkEnded).is_some());
        assert_eq!(gap.total(at(12)), Duration::from_secs(5));
    }
}
