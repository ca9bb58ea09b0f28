//! The angle between a vector and the z axis, computed with one division and one polynomial.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::lanes::{multiply_add, polynomial};

/// Largest argument of the polynomial: tan(π/8).
const REACH: f64 = 0.414_213_562_373_095_03;

/// Coefficients of (atan(t)/t - 1)/t² as a polynomial in t², ascending, interpolated at Chebyshev nodes over
/// t² ≤ tan²(π/8). The angle is right to 6e-16 rad.
const SERIES: [f64; 12] = [
    -0.333_333_333_333_333_04,
    0.199_999_999_999_839_9,
    -0.142_857_142_827_697_38,
    0.111_111_108_531_972_79,
    -0.090_908_968_481_216_3,
    0.076_919_645_992_569_01,
    -0.066_606_730_863_385_98,
    0.058_152_535_489_421_245,
    -0.047_804_231_953_526_7,
    0.025_879_445_700_410_97,
    0.013_605_180_177_061_471,
    -0.034_532_477_933_680_56,
];

/// Returns atan2(ρ, z) for ρ ≥ 0, from 0 to π; NaN where both are zero or one is not a number.
///
/// Where the quotient would be large, the angle is measured from 45° or 90°. With ρ the opposite and |z| the adjacent
/// side, atan(ρ/|z|) = π/4 + atan((ρ-|z|)/(ρ+|z|)) = π/2 - atan(|z|/ρ).
#[inline(always)]
pub(super) fn angle_from_axis<const FUSED: bool, const W: usize>(rho: &[f64; W], z: &[f64; W]) -> [f64; W] {
    let (mut quotient, mut squared, mut turned) = ([0.0; W], [0.0; W], [0.0; W]);
    for j in 0..W {
        let (rho, height) = (rho[j], z[j].abs());
        let (low, high) = (rho <= REACH * height, REACH * rho >= height);
        let over = if low { rho } else { rho - height };
        let over = if high { -height } else { over };
        let under = if low { height } else { rho + height };
        let under = if high { rho } else { under };
        let turn = if low { 0.0 } else { FRAC_PI_4 };
        turned[j] = if high { FRAC_PI_2 } else { turn };
        quotient[j] = over / under;
        squared[j] = quotient[j] * quotient[j];
    }
    let series = polynomial::<FUSED, W>(&SERIES, &squared);
    let mut angle = [0.0; W];
    for j in 0..W {
        let correction = multiply_add::<FUSED>(quotient[j] * squared[j], series[j], quotient[j]);
        let acute = turned[j] + correction;
        angle[j] = if z[j] < 0.0 { PI - acute } else { acute };
    }
    angle
}

/// The distance of each point from the z axis, and the angle between its direction and that axis.
#[inline(always)]
pub(super) fn distance_and_angle<const FUSED: bool, const W: usize>([x, y, z]: &[[f64; W]; 3]) -> ([f64; W], [f64; W]) {
    let mut rho = [0.0; W];
    for j in 0..W {
        rho[j] = (x[j] * x[j] + y[j] * y[j]).sqrt();
    }
    let theta = angle_from_axis::<FUSED, W>(&rho, z);
    (rho, theta)
}

#[cfg(test)]
#[path = "../../tests/unit/arc_tangent.rs"]
mod tests;
