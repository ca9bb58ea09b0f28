//! Counts of outcomes.

use vergence_mcu::FlashOperation;

use super::sweep::{Cut, Ending, rank};

/// Most bricked boards that are listed; more are only counted.
const MOST_LISTED: usize = 20;

/// Counts of outcomes, by the kind of operation that was cut.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CutTally {
    /// Rows: cuts at erasures, at words of the swap's state, at other words. Columns: boards with the old image or
    /// settings, with the new ones, in recovery, bricked.
    pub by_operation: [[u64; 4]; 3],
    /// Number of starts that were made; the others equal one of these.
    pub started: u64,
    /// Number of boards on which a second attempt was made.
    pub updated: u64,
    /// Number and reason of each cut that bricked a board.
    pub bricked: Vec<(usize, String)>,
}

impl CutTally {
    /// Counts a cut.
    pub fn add(&mut self, cut: &Cut, operation: FlashOperation) {
        let ending = match &cut.ending {
            Ending::Old => 0,
            Ending::New => 1,
            Ending::Recovery => 2,
            Ending::Bricked(problem) => {
                self.bricked.push((cut.number, problem.clone()));
                3
            }
        };
        self.by_operation[rank(operation)][ending] += 1;
        self.started += u64::from(cut.started);
        self.updated += u64::from(cut.updated);
    }

    /// Adds the counts of another tally.
    pub fn merge(&mut self, other: &Self) {
        let cells = self.by_operation.iter_mut().flatten().zip(other.by_operation.iter().flatten());
        cells.for_each(|(sum, count)| *sum += count);
        self.started += other.started;
        self.updated += other.updated;
        self.bricked.extend(other.bricked.iter().cloned());
    }

    /// Number of cuts.
    #[must_use]
    pub fn cuts(&self) -> u64 {
        self.by_operation.iter().flatten().sum()
    }

    /// Number of boards by outcome: old image, new one, recovery, bricked.
    #[must_use]
    pub fn endings(&self) -> [u64; 4] {
        std::array::from_fn(|ending| self.by_operation.iter().map(|row| row[ending]).sum())
    }

    /// A row for each kind of operation that was cut, for people.
    #[must_use]
    pub fn table(&self) -> String {
        let head = format!("{:<18}{:>8}{:>10}{:>10}{:>10}{:>9}", "cut at", "cuts", "old", "new", "recovery", "bricked");
        let names = ["an erasure", "a word of state", "another word"];
        let rows = names.iter().zip(self.by_operation).map(|(name, row)| {
            let [old, new, recovery, bricked] = row;
            let cuts: u64 = row.iter().sum();
            format!("{name:<18}{cuts:>8}{old:>10}{new:>10}{recovery:>10}{bricked:>9}")
        });
        std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
    }

    /// The first bricked boards, each with its reason; `None` where there are none.
    #[must_use]
    pub fn accusation(&self) -> Option<String> {
        if self.bricked.is_empty() {
            return None;
        }
        let listed = self.bricked.iter().take(MOST_LISTED);
        let lines: Vec<String> = listed.map(|(number, why)| format!("  cut {number}: {why}")).collect();
        Some(format!("{} boards bricked:\n{}", self.bricked.len(), lines.join("\n")))
    }
}
