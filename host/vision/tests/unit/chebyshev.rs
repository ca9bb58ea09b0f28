//! Tests of `src/batch/chebyshev.rs`, of what is private there.

use super::*;

#[test]
fn a_polynomial_is_approximated_by_itself() {
    let found = fit(5, |t| 2.0 - t + 0.5 * t * t - 3.0 * t.powi(4));
    for (found, expected) in found.iter().zip([2.0, -1.0, 0.5, 0.0, -3.0]) {
        assert!((found - expected).abs() < 1e-14, "{found:?}");
    }
}

#[test]
fn an_exponential_is_approximated_to_rounding() {
    let fit = fit(16, f64::exp);
    for i in -100..=100 {
        let t = f64::from(i) / 100.0;
        let value = fit.iter().rev().fold(0.0, |sum, c| sum * t + c);
        assert!((value - t.exp()).abs() < 3e-15, "{t}");
    }
}
