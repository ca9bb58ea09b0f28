//! The last lines of what happened: orders, warnings, and the board's flight recorder.

use std::collections::VecDeque;

use serde_json::{Value, json};

/// Number of lines that are kept.
const KEPT: usize = 200;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// It happened.
    Note,
    /// Somebody should know.
    Warning,
    /// Something failed.
    Error,
}

impl Level {
    const fn as_str(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// The last lines, numbered from 1.
#[derive(Clone, Debug, Default)]
pub struct Log {
    lines: VecDeque<Value>,
    count: u64,
}

impl Log {
    /// Adds a line from `source`, such as `board`, at `seconds` of its clock.
    pub fn add(&mut self, source: &str, seconds: f64, level: Level, text: &str) {
        self.count += 1;
        self.lines.push_back(json!({
            "number": self.count, "source": source, "seconds": seconds, "level": level.as_str(), "text": text,
        }));
        while self.lines.len() > KEPT {
            self.lines.pop_front();
        }
    }

    /// The lines for a page. A page tells by their numbers which it has already.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({ "kind": "log", "lines": self.lines })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_lines_are_kept_and_their_numbers_go_on() {
        let mut log = Log::default();
        for _ in 0..KEPT + 7 {
            log.add("board", 1.5, Level::Warning, "a word");
        }
        let said = log.json();
        let lines = said["lines"].as_array().expect("lines");
        assert_eq!((lines.len(), &lines[0]["number"]), (KEPT, &json!(8)));
        assert_eq!(
            lines[KEPT - 1],
            json!({
                "number": KEPT + 7, "source": "board", "seconds": 1.5, "level": "warning", "text": "a word",
            })
        );
    }
}
