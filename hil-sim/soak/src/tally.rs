//! Counts of many scenarios, by kind.

use std::fmt::Display;

use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::faults::FaultKind;
use crate::promise::Violation;
use crate::scenario::Scenario;
use crate::simulation::{Board, Ending, run};

/// Most broken promises that are listed; more are only counted.
const MOST_LISTED: usize = 20;

/// The scenarios of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KindTally {
    /// The kind of fault.
    pub kind: FaultKind,
    /// Number of scenarios.
    pub scenarios: u64,
    /// Number that ended with everything at rest after the host gave up.
    pub safe_stops: u64,
    /// Number in which the host completed its script.
    pub completed: u64,
    /// Number in which a promise was broken.
    pub violated: u64,
}

/// The outcomes of many scenarios.
#[derive(Clone, Debug, PartialEq)]
pub struct Tally {
    /// The counts of each kind, in the order of [`FaultKind::ALL`].
    pub by_kind: Vec<KindTally>,
    /// Broken promises with the seeds of their scenarios, ordered by seed.
    pub violations: Vec<(u64, Violation)>,
    /// Virtual time of all scenarios together, seconds.
    pub virtual_seconds: f64,
}

/// Runs the scenarios of `count` seeds from `first` on, each with a board of its own that `board` makes, on all cores;
/// `progress` is called after each, on any of them. The result does not depend on how many there are.
///
/// # Errors
/// An error of `board`.
pub fn soak<B: Board, E: Send>(
    first: u64,
    count: u64,
    board: impl Fn(&Scenario) -> Result<B, E> + Sync,
    progress: impl Fn() + Sync,
) -> Result<Tally, E> {
    let results: Vec<_> = (0..count)
        .into_par_iter()
        .map(|index| {
            let scenario = Scenario::of(first.wrapping_add(index));
            let outcome = run(&scenario, &mut board(&scenario)?);
            progress();
            Ok((scenario.seed, scenario.kind, outcome.ending, outcome.violations, outcome.virtual_time))
        })
        .collect::<Result<_, E>>()?;
    let empty = |kind| KindTally { kind, scenarios: 0, safe_stops: 0, completed: 0, violated: 0 };
    let mut tally = Tally { by_kind: FaultKind::ALL.map(empty).to_vec(), violations: Vec::new(), virtual_seconds: 0.0 };
    for (seed, kind, ending, violations, time) in results {
        tally.virtual_seconds += time.0 as f64 * 1e-6;
        if let Some(row) = tally.by_kind.iter_mut().find(|row| row.kind == kind) {
            row.scenarios += 1;
            match ending {
                _ if !violations.is_empty() => row.violated += 1,
                Ending::SafeStop => row.safe_stops += 1,
                Ending::Completed => row.completed += 1,
            }
        }
        tally.violations.extend(violations.into_iter().map(|violation| (seed, violation)));
    }
    Ok(tally)
}

impl Tally {
    /// The counts of each kind that occurred, as a table for people.
    #[must_use]
    pub fn table(&self) -> String {
        let head =
            format!("{:<18}{:>10}{:>11}{:>11}{:>10}", "fault", "scenarios", "completed", "safe stops", "violated");
        let rows = self.by_kind.iter().filter(|row| row.scenarios > 0).map(|row| {
            format!(
                "{:<18}{:>10}{:>11}{:>11}{:>10}",
                row.kind, row.scenarios, row.completed, row.safe_stops, row.violated
            )
        });
        std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
    }

    /// The counts for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let by_fault: Map<String, Value> = self
            .by_kind
            .iter()
            .map(|row| {
                let counts =
                    json!({ "scenarios": row.scenarios, "safe_stops": row.safe_stops, "completed": row.completed });
                (row.kind.name().to_owned(), counts)
            })
            .collect();
        json!({ "violations": self.violations.len(), "by_fault": by_fault })
    }

    /// The first broken promises with the seeds of their scenarios, and how to replay one; `None` where all were kept.
    #[must_use]
    pub fn accusation(&self) -> Option<String> {
        accusation(&self.violations, "vergence soak --only")
    }
}

/// The first of broken promises with the seeds of their scenarios, and by which command to replay one; `None` where all were kept.
pub(crate) fn accusation<V: Display>(violations: &[(u64, V)], replay: &str) -> Option<String> {
    let (first, _) = violations.first()?;
    let listed = violations.iter().take(MOST_LISTED);
    let lines: Vec<String> = listed.map(|(seed, violation)| format!("  seed {seed}: {violation}")).collect();
    let count = violations.len();
    Some(format!("{count} promises broken:\n{}\nreplay one: {replay} {first}", lines.join("\n")))
}
