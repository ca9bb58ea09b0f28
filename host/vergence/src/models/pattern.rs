//! A picture that networks find keypoints in, the same every time.

/// `side` × `side` pixels with squares of all greys by rows, 0 to 1.
#[must_use]
pub fn pattern(side: usize) -> Vec<f32> {
    /// Pixels for each square.
    const AREA: usize = 164;
    let mut values = vec![0.5; side * side];
    let mut state: u32 = 1;
    // A linear congruential generator (Numerical Recipes, 2nd ed., §7.1): a pattern needs no better one.
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
