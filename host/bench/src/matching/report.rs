//! The outcome of a way of matching for people and for programs.

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
        for (name, class) in [("sharp", &after.sharp), ("coarse", &after.coarse)] {
            if class.count > 0 {
                line += &format!(
                    "; {name} {} sigma {:.2} px, spread {:.2} px, NEES {:.2}, {:.0} % within 2 sigma",
                    class.count,
                    class.sigma_px,
                    class.spread_px,
                    class.nees,
                    100.0 * class.within_two_sigma
                );
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
        let class = |class: &Class| {
            json!({
                "count": class.count,
                "sigma_px": rounded(class.sigma_px),
                "spread_px": rounded(class.spread_px),
                "range_nees": rounded(class.nees),
                "within_two_sigma": rounded(class.within_two_sigma),
            })
        };
        json!({
            "before": counts(&self.before),
            "after": counts(&self.after),
            "median_bearing_error_deg": rounded(self.after.median_bearing_error.deg()),
            "sharp": class(&self.after.sharp),
            "coarse": class(&self.after.coarse),
            "drift": self.drift.as_ref().map(|drift| json!({
                "deg": rounded(drift.angle.deg()), "significant": drift.is_significant()
            })),
            "dropped": self.dropped,
            "seconds": rounded(self.seconds),
            "network_seconds": rounded(self.network_seconds),
        })
    }
}
