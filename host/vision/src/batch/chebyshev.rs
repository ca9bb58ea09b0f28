//! Polynomial approximation of smooth functions.
//!
//! L. Trefethen, *Approximation Theory and Approximation Practice*, 2013, chapters 3 and 4.

use std::f64::consts::PI;

/// Approximates `function` over t from -1 to 1 by a polynomial of `terms` terms; returns its coefficients, ascending in
/// t.
///
/// The polynomial is the Chebyshev series from four nodes per term, written in powers of t. This conversion keeps all
/// significant digits while the series falls by more than (1 + √2) per term. Callers check the error themselves.
pub(super) fn fit(terms: usize, function: impl Fn(f64) -> f64) -> Vec<f64> {
    let values: Vec<f64> = nodes(terms).map(function).collect();
    powers(&series(terms, &values))
}

fn angles(terms: usize) -> impl Iterator<Item = f64> {
    let count = 4 * terms;
    (0..count).map(move |i| PI * (i as f64 + 0.5) / count as f64)
}

/// The nodes of a polynomial of `terms` terms.
pub(super) fn nodes(terms: usize) -> impl Iterator<Item = f64> {
    angles(terms).map(f64::cos)
}

/// The coefficients of Chebyshev polynomials by the values at the nodes.
pub(super) fn series(terms: usize, values: &[f64]) -> Vec<f64> {
    let coefficient = |n: usize| {
        let sum: f64 = angles(terms).zip(values).map(|(angle, value)| value * (n as f64 * angle).cos()).sum();
        sum * if n == 0 { 1.0 } else { 2.0 } / values.len() as f64
    };
    (0..terms).map(coefficient).collect()
}

/// Converts Σ cₙ Tₙ(t) to powers of t by Clenshaw's recurrence on coefficients: b ← c + 2 t b' - b''.
pub(super) fn powers(series: &[f64]) -> Vec<f64> {
    let terms = series.len();
    let (mut next, mut after) = (vec![0.0; terms + 1], vec![0.0; terms + 1]);
    for (n, c) in series.iter().enumerate().rev() {
        // The last step multiplies by t, not by 2 t.
        let factor = if n == 0 { 1.0 } else { 2.0 };
        let mut current: Vec<f64> = after.iter().map(|a| -a).collect();
        for (i, b) in next.iter().enumerate().take(terms) {
            current[i + 1] += factor * b;
        }
        current[0] += c;
        after = std::mem::replace(&mut next, current);
    }
    next.truncate(terms);
    next
}

#[cfg(test)]
#[path = "../../tests/unit/chebyshev.rs"]
mod tests;
