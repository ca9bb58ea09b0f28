//! The table of an axis's pitch error: where the stage truly is beside where its encoder says.

/// Largest slope of a table: beyond it a scale would be wrong, not its pitch.
const STEEPEST: f64 = 0.1;

/// Errors of an encoder's scale over the travel, linear between the entries, and constant beyond the ends. Empty: no error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PitchTable {
    /// Positions by the encoder, and how much further the stage is, in millimetres or radians.
    entries: Vec<[f64; 2]>,
}

/// Why entries make no table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PitchTableError {
    /// One entry says nothing of a pitch.
    #[error("needs two entries or more")]
    TooShort,
    /// An entry's position, counted from 1, is not above that of the entry before.
    #[error("entry {0}: its position must be above that of the entry before")]
    NotRising(usize),
    /// Up to an entry, counted from 1, the error changes too fast.
    #[error("entry {0}: the error must not change by more than a tenth of the way from the entry before")]
    TooSteep(usize),
}

impl PitchTable {
    /// A table of these positions by the encoder and errors, in millimetres or radians.
    ///
    /// # Errors
    /// [`PitchTableError`] names the first entry that cannot be.
    pub fn new(entries: Vec<[f64; 2]>) -> Result<Self, PitchTableError> {
        if entries.len() < 2 {
            return Err(PitchTableError::TooShort);
        }
        for (number, pair) in (2..).zip(entries.windows(2)) {
            let [way, change] = [0, 1].map(|column| pair[1][column] - pair[0][column]);
            if way.is_nan() || way <= 0.0 {
                return Err(PitchTableError::NotRising(number));
            }
            if change.is_nan() || change.abs() > STEEPEST * way {
                return Err(PitchTableError::TooSteep(number));
            }
        }
        Ok(Self { entries })
    }

    /// The entries: positions by the encoder, and errors.
    #[must_use]
    pub fn entries(&self) -> &[[f64; 2]] {
        &self.entries
    }

    /// The true position where the encoder says `encoder`.
    #[must_use]
    pub fn truth(&self, encoder: f64) -> f64 {
        encoder + interpolated(&self.entries, encoder, |[position, error]| [position, error])
    }

    /// What the encoder says at the true position `truth`: the inverse of [`Self::truth`].
    #[must_use]
    pub fn encoder(&self, truth: f64) -> f64 {
        // The slope is bounded, so that the true positions rise as those of the encoder do, and are linear between them.
        truth - interpolated(&self.entries, truth, |[position, error]| [position + error, error])
    }
}

/// The value at `at` between the points that `point` makes of the entries; that of the nearest one beyond their ends.
fn interpolated(entries: &[[f64; 2]], at: f64, point: impl Fn([f64; 2]) -> [f64; 2]) -> f64 {
    let next = entries.partition_point(|&entry| point(entry)[0] <= at);
    match (next.checked_sub(1).and_then(|before| entries.get(before)), entries.get(next)) {
        (Some(&before), Some(&after)) => {
            let ([from, error], [to, other]) = (point(before), point(after));
            error + (at - from) / (to - from) * (other - error)
        }
        (Some(&end), None) | (None, Some(&end)) => end[1],
        (None, None) => 0.0,
    }
}
