//! Tests of `src/batch/plane.rs`, of what is private there.
#![allow(clippy::expect_used, reason = "a test may fail")]

use super::*;
use crate::Radtan;

#[test]
fn places_go_where_the_model_says_and_slopes_are_those_of_places() {
    const STEP: f64 = 1e-6;
    let coefficients = [0.2, -0.1, 1e-3, -5e-4, 0.02, 0.5, 0.1, 0.01, 1e-3, -1e-3, 5e-4, 2e-4];
    for count in [4, 5, 8, 12] {
        let radtan = Radtan::new(&coefficients[..count]).expect("a number of coefficients that OpenCV knows");
        let plane = Plane::new(&radtan.coefficients);
        for place in 0..50 {
            let (sin, cos) = (2.4 * f64::from(place)).sin_cos();
            let at = [0.02 * f64::from(place) * cos, 0.02 * f64::from(place) * sin];
            let expected = radtan.distorted(at);
            let found = plane.moved_with_slopes::<false, 1>(&at.map(|x| [x]));
            for (found, expected) in [plane.moved::<false, 1>(at.map(|x| [x])), found.at]
                .iter()
                .flatten()
                .zip([expected, expected].iter().flatten())
            {
                assert!((found[0] - expected).abs() < 1e-15, "{count}: {found:?}, {expected}");
            }
            for axis in 0..2 {
                let moved = |sign: f64| {
                    let mut moved = at;
                    moved[axis] += sign * STEP;
                    radtan.distorted(moved)
                };
                let (ahead, behind) = (moved(1.0), moved(-1.0));
                for row in 0..2 {
                    let slope = (ahead[row] - behind[row]) / (2.0 * STEP);
                    assert!((found.by[row][axis][0] - slope).abs() < 1e-8, "{count}, {row}, {axis}: {slope}");
                }
            }
        }
    }
}
