//! A drawn test image with keypoints, the same every time.

use vergence_matching::learned::{GreyImage, KeypointMatches, Model, NetworkError};

/// Most keypoints of the small pattern that are matched.
pub const SMALL_KEYPOINTS: usize = 512;

/// Squares of random place, size and grey level.
pub struct Pattern {
    values: Vec<f32>,
    side: usize,
}

impl Pattern {
    /// 256 × 256 pixels: enough to see that a model works and which runtime is faster, with [`SMALL_KEYPOINTS`].
    #[must_use]
    pub fn small() -> Self {
        Self::new(256)
    }

    /// `side` × `side` pixels.
    #[must_use]
    pub fn new(side: usize) -> Self {
        Self { values: squares(side), side }
    }

    /// Grey levels by rows, 0 to 1.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Matches the pattern with itself: a sound model finds nearly as many matches as keypoints.
    ///
    /// # Errors
    /// Fails if the networks fail.
    pub fn with_itself(&self, model: &Model, keypoints: usize) -> Result<KeypointMatches, NetworkError> {
        let picture = GreyImage { values: &self.values, width: self.side, height: self.side };
        model.compare([picture, picture], keypoints, [&|_| true, &|_| true])
    }
}

fn squares(side: usize) -> Vec<f32> {
    /// Pixels of the pattern for each square drawn.
    const AREA: usize = 164;
    let mut values = vec![0.5; side * side];
    let mut state: u32 = 1;
    // A linear congruential generator (Numerical Recipes, 2nd ed., §7.1): good enough for a pattern.
    let mut next = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % below
    };
    for _ in 0..side * side / AREA {
        let (x, y, size, grey) = (next(side), next(side), 6 + next(24), next(256) as f32 / 255.0);
        for row in y..(y + size).min(side) {
            values[row * side + x..row * side + (x + size).min(side)].fill(grey);
        }
    }
    values
}
