//! Many sessions, and what they have shown.

use rayon::prelude::*;
use serde_json::{Value, json};
use vergence_control::SettingsError;

use super::delivered::Delivered;
use super::difference::{Difference, Figures, Verdict};
use super::driver::play;
use super::session::Session;
use super::steps::Phase;
use crate::stages::stages;

/// Most differences that are listed; more are only counted.
const MOST_LISTED: usize = 20;

/// The outcome of many sessions.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferentialTally {
    /// Number of sessions.
    pub sessions: u64,
    /// The first difference of each session that had one, with its seed.
    pub differences: Vec<(u64, Difference)>,
    /// What was compared.
    pub figures: Figures,
    /// Virtual time of all sessions together, seconds.
    pub virtual_seconds: f64,
}

impl Session {
    /// Plays the session on both boards, just switched on.
    ///
    /// # Errors
    /// [`SettingsError`] where the stages cannot be controlled.
    pub fn on_both(&self, boards: &Delivered) -> Result<Verdict, SettingsError> {
        let mechanics = stages().map(|stage| stage.mechanics);
        let native = boards.native(&stages(), &self.positions, self.seed as u32)?;
        Ok(play(self, native, boards.chip(&mechanics, &self.positions), boards.next()))
    }
}

/// Plays the sessions of `count` seeds from `first` on, on all cores; `progress` is called after each, on any of them.
///
/// # Errors
/// [`SettingsError`] where the stages cannot be controlled.
pub fn differential(
    first: u64,
    count: u64,
    boards: &Delivered,
    progress: impl Fn() + Sync,
) -> Result<DifferentialTally, SettingsError> {
    let verdicts: Vec<_> = (0..count)
        .into_par_iter()
        .map(|index| {
            let seed = first.wrapping_add(index);
            let verdict = Session::of(seed).on_both(boards)?;
            progress();
            Ok((seed, verdict))
        })
        .collect::<Result<_, SettingsError>>()?;
    let empty = DifferentialTally {
        sessions: count,
        differences: Vec::new(),
        figures: Figures::default(),
        virtual_seconds: 0.0,
    };
    Ok(verdicts.into_iter().fold(empty, |mut tally, (seed, verdict)| {
        tally.virtual_seconds += verdict.virtual_seconds;
        tally.figures.merge(&verdict.figures);
        tally.differences.extend(verdict.difference.map(|difference| (seed, difference)));
        tally
    }))
}

impl DifferentialTally {
    /// What was compared, and how far apart it was, for people.
    #[must_use]
    pub fn table(&self) -> String {
        let figures = &self.figures;
        let mut lines = vec![
            format!("{:<28}{:>12}", "messages", figures.messages),
            format!("{:<28}{:>12}", "poses", figures.poses),
            format!("{:<28}{:>12}", "  seen some ticks apart", figures.poses_a_tick_apart),
            format!("{:<28}{:>12}", "step instants", figures.steps),
            format!("{:<28}{:>12}", "  motions some ticks apart", figures.motions_apart),
            format!("{:<28}{:>12}", "faults with two names", figures.named_apart),
        ];
        let apart = Phase::ALL.iter().zip(figures.step_us.iter().zip(figures.step_share));
        lines.extend(apart.map(|(phase, (us, share))| {
            format!("{:<28}{us:>9.1} us{share:>9.2} steps", format!("steps, {}", phase.name()))
        }));
        lines.push(format!("{:<28}{:>9.0} us", "counts in mid-move", figures.lag_us));
        for (axis, counts) in figures.rest_counts.iter().enumerate() {
            lines.push(format!("{:<28}{counts:>12}", format!("counts at rest, axis {axis}")));
        }
        lines.push(format!("{:<28}{:>9} us", "requests", figures.request_us));
        lines.join("\n")
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let figures = &self.figures;
        let by_phase = |values: [f64; 5]| -> serde_json::Map<_, _> {
            Phase::ALL.iter().zip(values).map(|(phase, value)| (phase.name().to_owned(), value.into())).collect()
        };
        json!({
            "sessions": self.sessions,
            "differences": self.differences.len(),
            "messages": figures.messages,
            "poses": figures.poses,
            "poses_some_ticks_apart": figures.poses_a_tick_apart,
            "steps": figures.steps,
            "motions_some_ticks_apart": figures.motions_apart,
            "faults_with_two_names": figures.named_apart,
            "steps_us_apart": by_phase(figures.step_us),
            "steps_apart": by_phase(figures.step_share),
            "counts_us_apart": figures.lag_us,
            "counts_apart_at_rest": figures.rest_counts,
            "requests_us_apart": figures.request_us,
        })
    }

    /// The first differences with the seeds of their sessions, and how to replay one; `None` where there are none.
    #[must_use]
    pub fn accusation(&self) -> Option<String> {
        let (first, _) = self.differences.first()?;
        let listed = self.differences.iter().take(MOST_LISTED);
        let lines: Vec<String> = listed.map(|(seed, difference)| format!("  seed {seed}: {difference}")).collect();
        Some(format!(
            "{} sessions differ:\n{}\nreplay one: vergence soak --differential --only {first}",
            self.differences.len(),
            lines.join("\n")
        ))
    }
}
