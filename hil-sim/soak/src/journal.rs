//! The events of a scenario as text.

use std::fmt;

use vergence_protocol::Microseconds;

/// Events in order of time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Journal {
    events: Vec<(Microseconds, String)>,
}

impl Journal {
    /// Adds an event at the true time `at`.
    pub fn note(&mut self, at: Microseconds, what: impl Into<String>) {
        self.events.push((at, what.into()));
    }

    /// All events.
    #[must_use]
    pub fn events(&self) -> &[(Microseconds, String)] {
        &self.events
    }
}

impl fmt::Display for Journal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, what) in &self.events {
            writeln!(f, "{:>12.6} s  {what}", at.0 as f64 * 1e-6)?;
        }
        Ok(())
    }
}
