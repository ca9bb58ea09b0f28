//! Counts of many scenarios of a robot, by kind of harm.

use rayon::prelude::*;
use serde_json::{Map, Value, json};
use vergence_rig::Rig;

use super::board::RobotBoard;
use super::checker::RobotViolation;
use super::harm::HarmKind;
use super::play::run_robot;
use super::scenario::RobotScenario;
use crate::tally::accusation;

/// The outcomes of many scenarios.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotTally {
    /// Kind of harm, number of scenarios, of those with a fault, of those from which no path led back, and of those with a
    /// broken promise.
    pub by_kind: Vec<(HarmKind, [u64; 4])>,
    /// Broken promises with the seeds of their scenarios, ordered by seed.
    pub violations: Vec<(u64, RobotViolation)>,
    /// Virtual time of all scenarios together, seconds.
    pub virtual_seconds: f64,
}

/// Runs the scenarios of `count` seeds from `first` on, each with a board of its own that `board` makes, on all cores; `progress` is
/// called after each, on any of them. The result does not depend on how many there are.
///
/// # Errors
/// An error of `board`.
pub fn soak_robot<B: RobotBoard, E: Send>(
    rig: &Rig,
    first: u64,
    count: u64,
    board: impl Fn(&RobotScenario) -> Result<B, E> + Sync,
    progress: impl Fn() + Sync,
) -> Result<RobotTally, E> {
    let results: Vec<_> = (0..count)
        .into_par_iter()
        .map(|index| {
            let scenario = RobotScenario::of(first.wrapping_add(index), rig.modes.len());
            let outcome = run_robot(rig, &scenario, &mut board(&scenario)?);
            progress();
            Ok((scenario, outcome))
        })
        .collect::<Result<_, E>>()?;
    let mut tally = RobotTally {
        by_kind: HarmKind::ALL.map(|kind| (kind, [0; 4])).to_vec(),
        violations: Vec::new(),
        virtual_seconds: 0.0,
    };
    for (scenario, outcome) in results {
        tally.virtual_seconds += outcome.virtual_time.0 as f64 * 1e-6;
        if let Some((_, row)) = tally.by_kind.iter_mut().find(|(kind, _)| *kind == scenario.kind) {
            row[0] += 1;
            row[1] += u64::from(outcome.fault.is_some());
            row[2] += u64::from(outcome.left_to_hands);
            row[3] += u64::from(!outcome.violations.is_empty());
        }
        tally.violations.extend(outcome.violations.into_iter().map(|violation| (scenario.seed, violation)));
    }
    Ok(tally)
}

impl RobotTally {
    /// The counts of each kind that occurred, as a table for people.
    #[must_use]
    pub fn table(&self) -> String {
        let head = format!("{:<18}{:>10}{:>8}{:>9}{:>10}", "harm", "scenarios", "faults", "by hand", "violated");
        let rows = self.by_kind.iter().filter(|(_, [scenarios, ..])| *scenarios > 0);
        let rows = rows.map(|(kind, [scenarios, faults, by_hand, violated])| {
            format!("{:<18}{scenarios:>10}{faults:>8}{by_hand:>9}{violated:>10}", kind.name())
        });
        std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
    }

    /// The counts for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let by_harm: Map<String, Value> = self
            .by_kind
            .iter()
            .map(|(kind, [scenarios, faults, by_hand, _])| {
                (kind.name().to_owned(), json!({ "scenarios": scenarios, "faults": faults, "by_hand": by_hand }))
            })
            .collect();
        json!({ "violations": self.violations.len(), "by_harm": by_harm })
    }

    /// The first broken promises with the seeds of their scenarios, and how to replay one; `None` where all were kept.
    #[must_use]
    pub fn accusation(&self) -> Option<String> {
        accusation(&self.violations, "vergence soak --robot RIG --only")
    }
}
