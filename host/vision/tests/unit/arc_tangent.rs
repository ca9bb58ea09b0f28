//! Tests of `src/batch/arc_tangent.rs`, of what is private there.

use super::*;

#[test]
fn agrees_with_the_library_over_the_whole_circle() {
    for i in 0..=1_000_000 {
        let expected = PI * f64::from(i) * 1e-6;
        let (rho, z) = (expected.sin().max(0.0), expected.cos());
        let exact = rho.atan2(z);
        for [found] in [angle_from_axis::<false, 1>(&[rho], &[z]), angle_from_axis::<true, 1>(&[rho], &[z])] {
            assert!((found - exact).abs() <= 1e-15 * (1.0 + exact), "{found} for {exact}");
        }
    }
    assert!(angle_from_axis::<false, 1>(&[0.0], &[0.0])[0].is_nan());
    assert!(angle_from_axis::<false, 1>(&[f64::NAN], &[1.0])[0].is_nan());
    assert!(angle_from_axis::<false, 1>(&[1.0], &[f64::NAN])[0].is_nan());
}
