//! The latest message of every stream. Nothing queues: a page that is slow gets the newest of each, and skips what was in between.

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;

/// A stream of messages of which only the latest counts, in the order in which a new page gets them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Who drives.
    Control,
    /// The board: pose, state, fault, clock, link.
    Status,
    /// Where the cameras are and which directions they see.
    View,
    /// The points of the newest pair.
    Cloud,
    /// The left image of that pair.
    Left,
    /// The right image of that pair.
    Right,
    /// What is seen and how well, over all directions.
    Sphere,
    /// How far a set of target views has come.
    Capture,
    /// Where a recording stands that is played.
    Playback,
    /// What the live loop does without.
    Ladder,
    /// The last lines of the log.
    Log,
}

/// Number of streams.
const COUNT: usize = 11;

/// A message to a page; a clone shares its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outgoing {
    /// JSON.
    Text(Utf8Bytes),
    /// A header in JSON and what follows it: see [`crate::packed`].
    Binary(Bytes),
}

/// The latest message of every stream, each with a number that grows with every message of any stream.
#[derive(Clone, Debug, Default)]
pub struct Streams {
    latest: [Option<(u64, Outgoing)>; COUNT],
    number: u64,
}

/// The numbers of the messages that a page got last, by stream.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen([u64; COUNT]);

impl Streams {
    /// Replaces the latest message of `stream`.
    pub fn put(&mut self, stream: Stream, message: Outgoing) {
        self.number += 1;
        self.latest[stream as usize] = Some((self.number, message));
    }

    /// The latest message of `stream`.
    #[must_use]
    pub fn latest(&self, stream: Stream) -> Option<&Outgoing> {
        self.latest[stream as usize].as_ref().map(|(_, message)| message)
    }

    /// The next message for a page that has `seen` others: of the stream that it has waited for longest. `None` where it has seen all.
    pub fn next(&self, seen: &mut Seen) -> Option<Outgoing> {
        let new = self.latest.iter().zip(&mut seen.0).filter_map(|(latest, seen)| {
            let (number, message) = latest.as_ref()?;
            (*number > *seen).then_some((seen, *number, message))
        });
        let (seen, number, message) = new.min_by_key(|(seen, ..)| **seen)?;
        *seen = number;
        Some(message.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Outgoing {
        Outgoing::Text(text.into())
    }

    #[test]
    fn a_page_that_comes_late_gets_the_latest_of_every_stream() {
        let mut streams = Streams::default();
        for (stream, message) in
            [(Stream::Cloud, "old"), (Stream::Left, "left"), (Stream::Cloud, "new"), (Stream::Status, "status")]
        {
            streams.put(stream, text(message));
        }
        let mut seen = Seen::default();
        let got: Vec<_> = std::iter::from_fn(|| streams.next(&mut seen)).collect();
        assert_eq!(got, [text("status"), text("new"), text("left")]);
        assert_eq!(streams.next(&mut seen), None);
    }

    #[test]
    fn a_slow_page_skips_and_no_busy_stream_starves_another() {
        let mut streams = Streams::default();
        let mut seen = Seen::default();
        streams.put(Stream::Status, text("0"));
        streams.put(Stream::Right, text("picture"));
        let mut got = Vec::new();
        for number in 1..=4 {
            got.extend(streams.next(&mut seen));
            // While one message is on its way, two of the busy stream come.
            streams.put(Stream::Status, text(&format!("{number}a")));
            streams.put(Stream::Status, text(&format!("{number}b")));
        }
        assert_eq!(got, [text("0"), text("picture"), text("2b"), text("3b")]);
    }
}
