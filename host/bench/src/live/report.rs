//! The figures of the live matcher in words and as JSON.

use serde_json::{Value, json};
use vergence_rig::rounded;
use vergence_vision::median;

use super::{DenseFigures, LiveFigures, PeerMatches, PeerMatching, STAGES};

/// Right points of a pair, and the part of all points that is right.
fn right(points: &[[usize; 2]]) -> [f64; 2] {
    let [right, all] = points.iter().fold([0, 0], |[right, all], of| [right + of[0], all + of[1]]);
    [right as f64 / points.len().max(1) as f64, right as f64 / all.max(1) as f64]
}

impl LiveFigures {
    /// Lines for people.
    #[must_use]
    pub fn in_words(&self) -> Vec<String> {
        let ([median_delay, last], [now, precision]) = (self.delay(), right(&self.points));
        let [single, single_precision] = right(&self.single);
        let alone = 1e3 * median(self.single_seconds.clone()).unwrap_or_default();
        let total: f64 = self.stages.iter().sum();
        let stages = STAGES.iter().zip(self.stages);
        let stages = stages.map(|(stage, seconds)| format!("{} {:.0} %", stage.as_str(), 100.0 * seconds / total));
        let first = 1e3 * self.latency.first().copied().unwrap_or_default();
        vec![
            format!(
                "{:.1} Hz ({} of {} pairs), {:.0} ms after the exposure (99 %: {:.0} ms; first cloud {first:.0} ms); \
                 {:.0} ms of one core a pair; {}; time for {} points",
                self.measured as f64 / self.seconds,
                self.measured,
                self.came,
                median_delay.as_secs_f64() * 1e3,
                last.as_secs_f64() * 1e3,
                1e3 * self.computed / self.measured as f64,
                stages.collect::<Vec<_>>().join(", "),
                self.limit(),
            ),
            format!(
                "{now:.0} right points a pair ({precision:.4}), {} in the first; views kept {} times; \
                 memory {} MiB, later {} MiB, at most {} MiB",
                self.points.first().map_or(0, |[right, _]| *right),
                self.kept_views,
                self.memory[0].resident,
                self.memory[1].resident,
                self.memory[1].peak
            ),
            self.dense.in_words(),
            format!("single pairs: {single:.0} right points ({single_precision:.4}) in {alone:.0} ms"),
        ]
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let ([median_delay, last], [now, precision]) = (self.delay(), right(&self.points));
        let [single, single_precision] = right(&self.single);
        json!({
            "rate_hz": rounded(self.measured as f64 / self.seconds),
            "came": self.came,
            "measured": self.measured,
            "skipped": self.came - self.measured,
            "latency_median_ms": rounded(median_delay.as_secs_f64() * 1e3),
            "latency_99_ms": rounded(last.as_secs_f64() * 1e3),
            "first_ms": rounded(1e3 * self.latency.first().copied().unwrap_or_default()),
            "computed_ms": rounded(1e3 * self.computed / self.measured as f64),
            "points_limit": self.limit(),
            "match_s": rounded(self.stages[0]),
            "triangulate_s": rounded(self.stages[1]),
            "right_points": rounded(now),
            "precision": rounded(precision),
            "single_right_points": rounded(single),
            "single_precision": rounded(single_precision),
            "first_right_points": self.points.first().map_or(0, |[right, _]| *right),
            "kept_views": self.kept_views,
            "dense": self.dense.json(),
            "single_ms": rounded(1e3 * median(self.single_seconds.clone()).unwrap_or_default()),
            "memory_mib": [self.memory[0].resident, self.memory[1].resident, self.memory[1].peak],
        })
    }
}

impl DenseFigures {
    fn in_words(&self) -> String {
        let ([seconds, share], [now, precision]) = (self.usual(), right(&self.points));
        format!(
            "ranges of {:.1} % of the pixels in {:.0} ms, and {now:.0} right points ({precision:.4}), at {:.0} Hz: {} of {} pairs skipped, \
             {:.0} ms after the exposure; memory at most {} MiB",
            100.0 * share,
            1e3 * seconds,
            self.rate,
            self.skipped(),
            self.came,
            1e3 * median(self.latency.clone()).unwrap_or_default(),
            self.peak
        )
    }

    fn json(&self) -> Value {
        let ([seconds, share], [now, precision]) = (self.usual(), right(&self.points));
        json!({
            "rate_hz": rounded(self.rate),
            "came": self.came,
            "skipped": self.skipped(),
            "ms": rounded(1e3 * seconds),
            "share": rounded(share),
            "latency_median_ms": rounded(1e3 * median(self.latency.clone()).unwrap_or_default()),
            "right_points": rounded(now),
            "precision": rounded(precision),
            "most_memory_mib": self.peak,
        })
    }
}

impl PeerMatches {
    /// A line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let one = |name: &str, of: &PeerMatching| {
            let [now, precision] = right_of(of);
            format!("{name} {now:.0} ({precision:.2}) in {:.0} ms", of.milliseconds)
        };
        format!("OpenCV {}: {}, {}", self.version, one("ORB", &self.orb), one("Lucas-Kanade", &self.flow))
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let one = |of: &PeerMatching| {
            let [now, precision] = right_of(of);
            json!({ "right": rounded(now), "precision": rounded(precision), "ms": rounded(of.milliseconds) })
        };
        json!({ "version": self.version, "orb": one(&self.orb), "lucas_kanade": one(&self.flow) })
    }
}

fn right_of(of: &PeerMatching) -> [f64; 2] {
    let [right, all] = of.matches;
    [right as f64 / of.pairs.max(1) as f64, right as f64 / all.max(1) as f64]
}
