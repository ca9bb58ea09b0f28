//! Counts that are kept from run to run, so that a sweep can go on where it stopped.

use serde_json::{Value, json};

use super::sweep::Sweep;
use super::tally::CutTally;

/// What was counted so far, and of which programs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CutState {
    /// Identifies the programs, such as by their hash, and the journey.
    programs: String,
    /// Number of cuts that were made: all before this one.
    pub done: usize,
    /// The counts.
    pub tally: CutTally,
}

/// Why a kept state cannot be continued.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CutStateError {
    /// The bytes are not a state.
    #[error("no state of power cuts: {0}")]
    Damaged(String),
    /// The cuts were made with other programs.
    #[error("these cuts were made with other programs or on another journey: take another file")]
    OtherPrograms,
}

impl CutState {
    /// Nothing counted yet of these programs.
    #[must_use]
    pub fn new(programs: String) -> Self {
        Self { programs, done: 0, tally: CutTally::default() }
    }

    /// Reads what [`Self::json`] wrote.
    ///
    /// # Errors
    /// [`CutStateError`]
    pub fn read(bytes: &[u8], programs: &str) -> Result<Self, CutStateError> {
        let damaged = |error: serde_json::Error| CutStateError::Damaged(error.to_string());
        let kept: Value = serde_json::from_slice(bytes).map_err(damaged)?;
        if kept["programs"] != programs {
            return Err(CutStateError::OtherPrograms);
        }
        let field = |name: &str| kept[name].clone();
        let number =
            |name: &str| field(name).as_u64().ok_or_else(|| CutStateError::Damaged(format!("'{name}' is missing")));
        let tally = CutTally {
            by_operation: serde_json::from_value(field("by_operation")).map_err(damaged)?,
            started: number("started")?,
            updated: number("updated")?,
            bricked: serde_json::from_value(field("bricked")).map_err(damaged)?,
        };
        Ok(Self { programs: programs.to_owned(), done: number("done")? as usize, tally })
    }

    /// The state to keep.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "programs": self.programs,
            "done": self.done,
            "by_operation": self.tally.by_operation,
            "started": self.tally.started,
            "updated": self.tally.updated,
            "bricked": self.tally.bricked,
        })
    }

    /// Makes and counts the cuts up to number `end`.
    pub fn cut(&mut self, sweep: &Sweep, end: usize) {
        self.tally.merge(&sweep.tally(&sweep.cut(self.done..end)));
        self.done = end;
    }

    /// The counts as a table, and a sentence on what was done.
    #[must_use]
    pub fn in_words(&self, sweep: &Sweep) -> String {
        format!(
            "{}\n{} operations of the flash in {}; {} cuts, {} starts made, the others equal one of these; {} second attempts",
            self.tally.table(),
            sweep.operations().len(),
            sweep.journey().in_words(),
            self.tally.cuts(),
            self.tally.started,
            self.tally.updated,
        )
    }

    /// The counts for programs.
    #[must_use]
    pub fn figures(&self, sweep: &Sweep) -> Value {
        let [old, new, recovery, bricked] = self.tally.endings();
        json!({
            "journey": sweep.journey().name(),
            "flash_operations": sweep.operations().len(),
            "cuts": self.tally.cuts(),
            "bricked": bricked,
            "booted_old": old,
            "booted_new": new,
            "recovery": recovery,
            "starts_made": self.tally.started,
            "updated_again": self.tally.updated,
        })
    }
}
