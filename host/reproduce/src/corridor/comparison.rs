//! The mission in many random corridors, with the modes chosen by different orders. The joints are placed, each off by its play:
//! no controller moves them.

use rayon::prelude::*;
use serde_json::{Value, json};
use vergence_rig::{Rig, rounded};
use vergence_scene::CorridorPlan;

use super::joints::PlacedJoints;
use super::mission::{Mission, Orders, Outcome, Outlooks};
use super::{Built, Sight};
use crate::error::DemoError;

/// Sets the corridors apart from the seeds of all else.
const CORRIDORS: u64 = 77_000;

/// What one kind of orders achieved over all corridors.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Who chose the modes.
    pub orders: Orders,
    /// One outcome for each corridor.
    pub outcomes: Vec<Outcome>,
}

/// Runs the mission in `count` corridors with every kind of orders. `done` hears of each corridor that is finished.
///
/// # Errors
/// Where the rig has no trunk or lacks a mode, or a pair cannot be measured.
pub fn compare(rig: &Rig, count: u32, sight: Sight, done: &(dyn Fn() + Sync)) -> Result<Vec<Comparison>, DemoError> {
    let outlooks = Outlooks::of(rig)?;
    let one = |seed: u64| -> Result<Vec<Outcome>, DemoError> {
        let corridor = Built::new(CorridorPlan::random(CORRIDORS + seed));
        let run = |orders| {
            let mut joints = PlacedJoints::new(rig, 100 * seed);
            let mission = Mission::new((&outlooks, &mut joints), &corridor, orders, sight, 100 * seed);
            mission.run(&mut |_| Ok(())).map(|(outcome, _)| outcome)
        };
        let outcomes = Orders::ALL.into_iter().map(run).collect();
        done();
        outcomes
    };
    let all = (0..u64::from(count)).into_par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    let of = |number: usize| all.iter().filter_map(|outcomes| outcomes.get(number).cloned()).collect();
    Ok(Orders::ALL
        .into_iter()
        .enumerate()
        .map(|(number, orders)| Comparison { orders, outcomes: of(number) })
        .collect())
}

impl Comparison {
    /// Mean time of a mission in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        mean(self.outcomes.iter().map(|outcome| outcome.seconds))
    }

    /// Mean part of the floor that was seen.
    #[must_use]
    pub fn area(&self) -> f64 {
        mean(self.outcomes.iter().map(|outcome| outcome.area))
    }

    /// Number of corridors in which the target was seen, and in which it was measured as well.
    #[must_use]
    pub fn found_and_measured(&self) -> [usize; 2] {
        let count = |is: fn(&Outcome) -> bool| self.outcomes.iter().filter(|outcome| is(outcome)).count();
        [count(|outcome| outcome.found), count(|outcome| outcome.target_error_mm.is_some())]
    }

    /// Median and 90th percentile of the target's absolute error in millimetres.
    #[must_use]
    pub fn target_error_mm(&self) -> [f64; 2] {
        let mut errors: Vec<f64> =
            self.outcomes.iter().filter_map(|outcome| outcome.target_error_mm).map(f64::abs).collect();
        errors.sort_by(f64::total_cmp);
        [0.5, 0.9].map(|share| errors.get((share * errors.len() as f64) as usize).copied().unwrap_or(f64::NAN))
    }

    /// Mean and standard deviation of the walls' errors in millimetres, over all stations of all corridors.
    #[must_use]
    pub fn wall_error_mm(&self) -> [f64; 2] {
        let errors = || self.outcomes.iter().flat_map(|outcome| outcome.wall_errors_mm.iter().copied());
        let mean_error = mean(errors());
        [mean_error, mean(errors().map(|error| (error - mean_error).powi(2))).sqrt()]
    }

    /// Share of the walls that too few points told.
    #[must_use]
    pub fn walls_missed(&self) -> f64 {
        let missed: usize = self.outcomes.iter().map(|outcome| outcome.walls_missed).sum();
        let measured: usize = self.outcomes.iter().map(|outcome| outcome.wall_errors_mm.len()).sum();
        missed as f64 / (missed + measured).max(1) as f64
    }

    /// Mean number of changes of the mode.
    #[must_use]
    pub fn changes(&self) -> f64 {
        mean(self.outcomes.iter().map(|outcome| outcome.changes as f64))
    }

    /// A row of the table.
    #[must_use]
    pub fn in_words(&self) -> String {
        let ([found, measured], [median, p90], [wall, spread]) =
            (self.found_and_measured(), self.target_error_mm(), self.wall_error_mm());
        format!(
            "{:<14}{:>6.1} s{:>7.1} %{found:>7}{measured:>10}{median:>9.2} mm{p90:>9.2} mm{wall:>+8.2} mm{spread:>8.2} mm{:>8.1} %{:>6.2}",
            self.orders.name(),
            self.seconds(),
            100.0 * self.area(),
            100.0 * self.walls_missed(),
            self.changes()
        )
    }

    /// The head of the table.
    pub const HEAD: &str =
        "modes by        time    area   found  measured  target: median    90 %   walls: mean  spread  missed changes";

    /// For programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let ([found, measured], [median, p90], [wall, spread]) =
            (self.found_and_measured(), self.target_error_mm(), self.wall_error_mm());
        json!({
            "modes_by": self.orders.name(),
            "seconds": rounded(self.seconds()),
            "area_seen": rounded(self.area()),
            "found": found,
            "measured": measured,
            "target_error_mm": { "median": rounded(median), "p90": rounded(p90) },
            "wall_error_mm": { "mean": rounded(wall), "spread": rounded(spread) },
            "walls_missed": rounded(self.walls_missed()),
            "changes": rounded(self.changes()),
        })
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}
