//! Radii near the one at which an image comes to a stand, as a variable by which the way back is smooth.
//!
//! Where the radius r grows no more with the angle, r is nearly a parabola there, and the angle nearly the root of what r is short of its largest,
//! r₁. No polynomial of r² comes near a root; one of w = √(1 - r²/r₁²) does. On the axis w is smooth by r², so that one polynomial serves the whole
//! field.

use super::radial::Growing;

/// The map from t, which r² is mapped to from -1 on the axis to 1 at the end of the field, to the variable that w is mapped to likewise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fold {
    /// w² = before - per t.
    before: f64,
    per: f64,
    /// The variable is slope w + shift.
    slope: f64,
    shift: f64,
}

impl Fold {
    /// Of a lens whose image comes to a stand a little beyond its field; `None` of others.
    pub(super) fn of(lens: &impl Growing) -> Option<Self> {
        let (most, still) = (lens.largest_radius(), still_radius(lens)?);
        let per = 0.5 * (most / still) * (most / still);
        let before = 1.0 - per;
        let rim = (before - per).max(0.0).sqrt();
        let slope = -2.0 / (1.0 - rim);
        Some(Self { before, per, slope, shift: 1.0 - slope * rim })
    }

    /// The variable.
    #[inline(always)]
    pub(super) fn variable(&self, t: f64) -> f64 {
        // Rounding may put the rim beyond the fold.
        let squared = self.before - self.per * t;
        self.slope * if squared > 0.0 { squared } else { 0.0 }.sqrt() + self.shift
    }

    /// t of a value of the variable.
    pub(super) fn t(&self, variable: f64) -> f64 {
        let w = (variable - self.shift) / self.slope;
        ((self.before - w * w) / self.per).clamp(-1.0, 1.0)
    }
}

impl Fold {
    /// For radii that are no function of their square: the variable is the radius itself.
    pub(super) const RADIUS: Self = Self { before: 0.5, per: -0.5, slope: 2.0, shift: -1.0 };
}

/// The radius at which the image comes to a stand, by a polynomial of the outermost part of the field that goes on beyond it.
fn still_radius(lens: &impl Growing) -> Option<f64> {
    const TERMS: usize = 10;
    /// The part of the field that the polynomial is fitted to, and the most that it goes on by.
    const PART: f64 = 0.2;
    const BEYOND: f64 = 0.1;
    let most = lens.theta_max();
    let half = 0.5 * PART * most;
    let series = super::chebyshev::fit(TERMS, |t| lens.radius(most - half + half * t).unwrap_or(f64::NAN));
    let slope = |t: f64| {
        let term = |(n, c): (usize, &f64)| n as f64 * c;
        series.iter().enumerate().skip(1).rev().fold(0.0, |sum, each| sum * t + term(each))
    };
    let (mut low, mut high) = (1.0, 1.0 + BEYOND / (0.5 * PART));
    if !(slope(low) > 0.0 && slope(high) < 0.0) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 { low = middle } else { high = middle }
    }
    let radius = series.iter().rev().fold(0.0, |sum, c| sum * low + c);
    // The last radius of the field lies before it.
    Some(radius.max(lens.largest_radius()))
}
