//! The outcome of a way of matching for people and for programs.

use std::fmt;

use serde_json::{Value, json};
use vergence_rig::rounded;

use crate::matching::judge::{Class, Tally};
use crate::matching::ways::Outcome;

impl Outcome {
    /// Counts, errors and times for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let count = |tally: &Tally| format!("{} ({:.2})", tally.correct, tally.precision());
        let after = &self.after;
        let mut line = format!(
            "{} -> {}, bearings {:.3}° off, {:.2} s of which {:.2} in networks",
            count(&self.before),
            count(after),
            after.median_bearing_error.deg(),
            self.seconds,
            self.network_seconds
        );
        for (name, class) in [("registered", &after.registered), ("unregistered", &after.unregistered)] {
            if class.count() > 0 {
                line += &format!("; {name} {class}");
            }
        }
        if let Some(drift) = &self.drift {
            let word = if drift.is_significant() { "disagree" } else { "agree" };
            line += &format!("; pose and picture {word} ({:.2}°)", drift.angle.deg());
        }
        line
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let counts = |tally: &Tally| json!({ "matches": tally.count, "correct": tally.correct, "precision": rounded(tally.precision()) });
        json!({
            "before": counts(&self.before),
            "after": counts(&self.after),
            "median_bearing_error_deg": rounded(self.after.median_bearing_error.deg()),
            "registered": self.after.registered.json(),
            "unregistered": self.after.unregistered.json(),
            "reliability": self.after.reliability.json(),
            "drift": self.drift.as_ref().map(|drift| json!({
                "deg": rounded(drift.angle.deg()), "significant": drift.is_significant()
            })),
            "dropped": self.dropped,
            "seconds": rounded(self.seconds),
            "network_seconds": rounded(self.network_seconds),
        })
    }
}

impl Class {
    /// The figures as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "count": self.count(),
            "sigma_px": rounded(self.sigma_px()),
            "spread_px": rounded(self.spread_px()),
            "range_nees": rounded(self.nees()),
            "within_one_sigma": rounded(self.within(1.0)),
            "within_two_sigma": rounded(self.within(2.0)),
            "within_three_sigma": rounded(self.within(3.0)),
        })
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} sigma {:.2} px, spread {:.2} px, NEES {:.2}, {:.1}, {:.1} and {:.1} % within 1, 2 and 3 sigma",
            self.count(),
            self.sigma_px(),
            self.spread_px(),
            self.nees(),
            100.0 * self.within(1.0),
            100.0 * self.within(2.0),
            100.0 * self.within(3.0)
        )
    }
}
