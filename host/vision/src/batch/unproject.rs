//! Unprojection of whole arrays of pixels to rays.
//!
//! With q = r², both sin θ / r and cos θ are smooth functions of q. A ray is (x A(q), y A(q), C(q)) with two
//! polynomials made once per lens, which needs no root, no iteration and no sine.

use super::chebyshev::fit;
use super::fold::Fold;
use super::lanes::{Kernel, over_rows, polynomial};
use super::radial::{Growing, Radial};
use crate::Pixel;

/// What rounding adds to t.
const TINY: f64 = 1e-12;
/// Rows per step. With fewer, polynomials wait for their own sums.
const LANES: usize = 32;
/// Numbers of polynomial terms that are tried, fewest first.
const TERMS: std::ops::RangeInclusive<usize> = 12..=48;

/// The polynomials and parameters of a lens that unprojection needs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unproject {
    sine_over_radius: Vec<f64>,
    cosine: Vec<f64>,
    centre: [f64; 2],
    per_aspect: f64,
    /// Factor of the map from r² to t in [-1, 1].
    slope: f64,
    largest_squared: f64,
    /// Where the image comes to a stand a little beyond the field.
    fold: Option<Fold>,
}

impl Unproject {
    /// `None` for a lens that no polynomial of 48 terms approximates closely enough, because dr/dθ comes close to zero.
    pub(super) fn new<L: Radial>(lens: &L) -> Option<Self> {
        Self::near(lens, None, 1)
    }

    /// The same, and by another variable where the image comes to a stand a little beyond the field.
    pub(super) fn of_growing(lens: &impl Growing) -> Option<Self> {
        /// Fewer numbers of terms are tried, because rays of models take long.
        const EVERY: usize = 6;
        let others = || [Fold::of(lens), Some(Fold::RADIUS)].into_iter().flatten();
        Self::near(lens, None, EVERY).or_else(|| others().find_map(|fold| Self::near(lens, Some(fold), EVERY)))
    }

    fn near<L: Radial>(lens: &L, fold: Option<Fold>, every: usize) -> Option<Self> {
        let of_terms = |terms| Self::of_terms(lens, terms, fold);
        TERMS.step_by(every).map(of_terms).find(|fit| fit.error(lens) <= L::LARGEST_ERROR)
    }

    fn of_terms(lens: &impl Radial, terms: usize, fold: Option<Fold>) -> Self {
        let largest = lens.largest_radius();
        let radius = |t: f64| radius(largest, fold, t);
        let sine_over_radius = fit(terms, |t| {
            let r = radius(t);
            if r > 0.0 { lens.angle(r).sin() / r } else { 1.0 / lens.on_axis() }
        });
        let cosine = fit(terms, |t| lens.angle(radius(t)).cos());
        let Pixel { u, v } = lens.middle();
        Self {
            sine_over_radius,
            cosine,
            centre: [u, v],
            per_aspect: 1.0 / lens.stretch(),
            slope: 2.0 / (largest * largest),
            largest_squared: largest * largest,
            fold,
        }
    }

    /// The radius at which the variable of the polynomials is `t`.
    pub(super) fn radius(&self, t: f64) -> f64 {
        radius(self.largest_squared.sqrt(), self.fold, t)
    }

    /// The largest error of a component of the ray, on a grid of radii.
    fn error(&self, lens: &impl Radial) -> f64 {
        const RADII: u32 = 500;
        let error = |i: u32| {
            let r = lens.largest_radius() * f64::from(i) / f64::from(RADII);
            let theta = lens.angle(r);
            let t = self.slope * r * r - 1.0;
            let t = [self.fold.map_or(t, |fold| fold.variable(t))];
            let [sine] = polynomial::<false, 1>(&self.sine_over_radius, &t);
            let [cosine] = polynomial::<false, 1>(&self.cosine, &t);
            (sine * r - theta.sin()).abs().max((cosine - theta.cos()).abs())
        };
        (0..=RADII).map(error).fold(0.0, f64::max)
    }
}

/// The radius in pixels at which the variable of polynomials up to the radius `largest` is `t`.
fn radius(largest: f64, fold: Option<Fold>, t: f64) -> f64 {
    largest * (0.5 * (fold.map_or(t, |fold| fold.t(t)) + 1.0)).max(0.0).sqrt()
}

impl Kernel<2, 3> for Unproject {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, pixels: [[f64; W]; 2]) -> [[f64; W]; 3] {
        self.rays::<FUSED, W>(pixels).0
    }
}

impl Unproject {
    /// The rays, and the variable of the polynomials.
    #[inline(always)]
    pub(super) fn rays<const FUSED: bool, const W: usize>(&self, [u, v]: [[f64; W]; 2]) -> ([[f64; W]; 3], [f64; W]) {
        let (mut x, mut y, mut t) = ([0.0; W], [0.0; W], [0.0; W]);
        for j in 0..W {
            x[j] = u[j] - self.centre[0];
            y[j] = (v[j] - self.centre[1]) * self.per_aspect;
            let squared = x[j] * x[j] + y[j] * y[j];
            t[j] = if squared <= self.largest_squared { self.slope * squared - 1.0 } else { f64::NAN };
        }
        if let Some(fold) = self.fold {
            for t in &mut t {
                // Not a number stays none.
                *t = if *t <= 1.0 + TINY { fold.variable(*t) } else { f64::NAN };
            }
        }
        let sine_over_radius = polynomial::<FUSED, W>(&self.sine_over_radius, &t);
        let cosine = polynomial::<FUSED, W>(&self.cosine, &t);
        for j in 0..W {
            x[j] *= sine_over_radius[j];
            y[j] *= sine_over_radius[j];
        }
        ([x, y, cosine], t)
    }
}

over_rows!(unproject_baseline, unproject_best, Unproject, LANES, 2 => 3);
