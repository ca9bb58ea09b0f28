//! The flight recorder as a story: what happened, and how long before or after the fault.

use serde_json::{Value, json};
use vergence_protocol::{FaultCode, Happening, Microseconds, RecordedEvent};
use vergence_rig::Rig;

use crate::board::Board;
use crate::console::Console;
use crate::failure::Failure;

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
    pub async fn read(board: &Board) -> Result<Self, Failure> {
        let (events, gone) = board.events().await?;
        let is_fault = |event: &&RecordedEvent| matches!(event.what, Happening::Fault { .. });
        let recorded = events.iter().rev().find(is_fault).map(|event| event.at);
        let (origin, since) = match (board.pose().fault, recorded) {
            (Some(fault), _) => (fault.at, "the fault"),
            (None, Some(at)) => (at, "the last fault, which was cleared"),
            (None, None) => (board.pose().at, "now; there was no fault"),
        };
        Ok(Self { events, gone, origin, since })
    }

    /// One line for each event.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn tell(&self, rig: &Rig, console: Console) -> Result<(), Failure> {
        console.say(format!("what happened, in seconds from {}", self.since))?;
        if self.gone > 0 {
            console.say(format!("              ({} earlier events are gone)", self.gone))?;
        }
        for event in &self.events {
            let seconds = self.relative_us(event) as f64 * 1e-6;
            console.say(format!("  {seconds:+11.6}  {}", in_words(rig, &event.what)))?;
        }
        Ok(())
    }

    /// For programs.
    pub fn json(&self, rig: &Rig) -> Value {
        let events = self.events.iter().map(|event| {
            json!({
                "board_us": event.at.0,
                "from_fault_us": self.relative_us(event),
                "text": in_words(rig, &event.what),
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

/// With the rig's names and units in place of numbers.
fn in_words(rig: &Rig, what: &Happening) -> String {
    let axis = |index: u8| rig.axes.get(usize::from(index));
    let name = |index: u8| axis(index).map_or_else(|| format!("axis {index}"), |axis| axis.name.clone());
    match *what {
        Happening::Fault { code, axis: Some(index), .. } => format!("FAULT on {}: {code}", name(index)),
        Happening::Fault { code, axis: None, .. } => format!("FAULT: {code}"),
        Happening::Switch { axis: index, home, closed } => {
            let (which, how) = (if home { "home" } else { "limit" }, if closed { "closed" } else { "opened" });
            format!("{}: {which} switch {how}", name(index))
        }
        Happening::Encoder { axis: index, counts } => match axis(index) {
            Some(axis) => format!("{} was at {} by its encoder", axis.name, axis.position_at(counts)),
            None => what.to_string(),
        },
        _ => what.to_string(),
    }
}
