//! Counting what became of boards.

use vergence_mcu::FlashOperation;

use super::sweep::{Cut, Ending, rank};

/// What became of boards, by what was cut.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CutTally {
    /// Cuts at erasures, words of the swap's state, other words; of each the boards that run the old image, the new
    /// one, wait in recovery, are bricked.
    pub by_operation: [[u64; 4]; 3],
    /// Starts that were made; the others equal one of these.
    pub started: u64,
    /// Boards that were updated once more.
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

    /// Adds what was counted elsewhere.
    pub fn merge(&mut self, other: &Self) {
        let cells = self.by_operation.iter_mut().flatten().zip(other.by_operation.iter().flatten());
        cells.for_each(|(sum, count)| *sum += count);
        self.started += other.started;
        self.updated += other.updated;
        self.bricked.extend(other.bricked.iter().cloned());
    }

    /// How many cuts.
    #[must_use]
    pub fn cuts(&self) -> u64 {
        self.by_operation.iter().flatten().sum()
    }

    /// How many boards ended so: old image, new one, recovery, bricked.
    #[must_use]
    pub fn endings(&self) -> [u64; 4] {
        std::array::from_fn(|ending| self.by_operation.iter().map(|row| row[ending]).sum())
    }
}
