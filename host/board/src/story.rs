//! The flight recorder as a story: what happened, and how long before or after the fault.

use serde_json::{Value, json};
use vergence_protocol::{FaultCode, Happening, Microseconds, RecordedEvent};
use vergence_rig::Rig;

use crate::{Board, BoardError, RecordedEvents, event_in_words};

/// What the board's recorder kept.
pub struct Story {
    events: Vec<RecordedEvent>,
    /// How many fell out of the ring.
    gone: u32,
    /// What times are told from: the latched fault, the last one recorded, or now.
    origin: Microseconds,
    since: &'static str,
}

impl Story {
    /// Reads the recorder.
    ///
    /// # Errors
    /// A firmware without recorder, or a link that ended.
    pub async fn read(board: &Board) -> Result<Self, BoardError> {
        let RecordedEvents { events, lost: gone, .. } = board.events().await?;
        let is_fault = |event: &&RecordedEvent| matches!(event.what, Happening::Fault { .. });
        let recorded = events.iter().rev().find(is_fault).map(|event| event.at);
        let (origin, since) = match (board.pose().fault, recorded) {
            (Some(fault), _) => (fault.at, "the fault"),
            (None, Some(at)) => (at, "the last fault, which was cleared"),
            (None, None) => (board.pose().at, "now; there was no fault"),
        };
        Ok(Self { events, gone, origin, since })
    }

    /// A heading, and one line for each event.
    #[must_use]
    pub fn lines(&self, rig: &Rig) -> Vec<String> {
        let mut lines = vec![format!("what happened, in seconds from {}", self.since)];
        if self.gone > 0 {
            lines.push(format!("              ({} earlier events are gone)", self.gone));
        }
        // Every verb opens a session: of several in a row only the last is shown.
        let mut sessions = 0;
        for (event, next) in self.events.iter().zip(self.events.iter().skip(1).map(Some).chain([None])) {
            let is_session = |event: &RecordedEvent| matches!(event.what, Happening::Opened(_));
            if is_session(event) && next.is_some_and(is_session) {
                sessions += 1;
                continue;
            }
            let before = if sessions > 0 { format!(" (and {sessions} before it)") } else { String::new() };
            sessions = 0;
            let seconds = self.relative_us(event) as f64 * 1e-6;
            lines.push(format!("  {seconds:+11.6}  {}{before}", event_in_words(rig, &event.what)));
        }
        lines
    }

    /// The same for programs: `times_from`, `gone` and `events`, with times in microseconds.
    #[must_use]
    pub fn json(&self, rig: &Rig) -> Value {
        let events = self.events.iter().map(|event| {
            json!({
                "board_us": event.at.0,
                "from_fault_us": self.relative_us(event),
                "text": event_in_words(rig, &event.what),
                "fault": fault_code(&event.what).map(|code| format!("{code:?}")),
            })
        });
        json!({ "times_from": self.since, "gone": self.gone, "events": events.collect::<Vec<_>>() })
    }

    fn relative_us(&self, event: &RecordedEvent) -> i64 {
        event.at.0.cast_signed().wrapping_sub(self.origin.0.cast_signed())
    }
}

fn fault_code(what: &Happening) -> Option<FaultCode> {
    match what {
        Happening::Fault { code, .. } => Some(*code),
        _ => None,
    }
}
