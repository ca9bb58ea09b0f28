//! Lenses with a moving pupil in whole arrays: points at finite distances to pixels, and pixels to rays with the places where they begin.
//!
//! With c the cosine of the direction of a point and i the inverse of its distance from the origin, the radius of its image over the sine of
//! its direction is a smooth function of both, whatever the pupil does. It is a polynomial in c for each power of i, made once per lens, so that
//! the angle itself is never computed. Points so near that few powers do not suffice are computed one by one.
//!
//! A point lies inside the field, up to θ, where (z - e(θ)) sin θ ≥ ρ cos θ.

use std::f64::consts::PI;

use super::chebyshev::{fit, nodes, powers, series};
use super::lanes::{Kernel, multiply_add, over_rows, polynomial, polynomial_at};
use super::radial::Radial;
use super::stepwise::ASK;
use super::unproject::Unproject;
use crate::KannalaBrandt;

/// Rows per step.
const LANES: usize = 64;
/// Rows per step of the way back.
const LANES_BACK: usize = 32;
/// Points nearer than so many times the pupil's coefficients are computed one by one.
const NEAR: f64 = 40.0;
/// The square of a distance in millimetres: farther points are computed one by one too.
const FAR: f64 = 1e30;
/// Powers of the inverse of the distance.
const POWERS: usize = 5;
/// Most terms of the polynomials in c.
const TERMS: usize = 24;
/// The largest error in radians, and the share of it that each power may leave out.
const LARGEST_ERROR: f64 = 9e-10;
const SHARE: f64 = 0.17;
/// By so much, in radians, a point's direction may lie beyond the field in which the lens sees it.
const BEYOND: f64 = 0.05;

/// Points to pixels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProjectByPupil {
    /// Ascending powers of the variable of the distance, each a polynomial in that of the direction.
    powers: Vec<Vec<f64>>,
    /// Factors and constants of the maps from c and from i to [-1, 1].
    direction: [f64; 2],
    distance: [f64; 2],
    centre: [f64; 2],
    aspect: f64,
    /// e(θ), and cot θ |cot θ|, at the end of the field.
    end: [f64; 2],
    near_squared: f64,
}

impl ProjectByPupil {
    /// `None` where no polynomials come near.
    pub(super) fn new(lens: &KannalaBrandt) -> Option<Self> {
        let [e0, e1] = lens.pupil().mm();
        let (near, theta_max) = (NEAR * (e0.abs() + 2.5 * e1.abs()), lens.theta_max().rad());
        let (least_cosine, cotangent) = ((theta_max + BEYOND).min(PI).cos(), theta_max.tan().recip());
        let (spread, centre) = (1.0 - least_cosine, lens.centre());
        let mut made = Self {
            powers: Vec::new(),
            direction: [2.0 / spread, -1.0 - 2.0 * least_cosine / spread],
            distance: [2.0 * near, -1.0],
            centre: [centre.u, centre.v],
            aspect: lens.aspect(),
            end: [lens.pupil().shift_mm(theta_max), cotangent * cotangent.abs()],
            near_squared: near * near,
        };
        let error = LARGEST_ERROR * lens.k()[0];
        let of_directions: Vec<Vec<f64>> = nodes(TERMS).map(|t| fit(POWERS, |s| made.exact(lens, t, s))).collect();
        for power in 0..POWERS {
            let values: Vec<f64> = of_directions.iter().map(|powers| powers[power]).collect();
            made.powers.push(shortened(&series(TERMS, &values), SHARE * error));
        }
        let is_near = |t: f64, s: f64| {
            let found = made.powers.iter().rev().fold(0.0, |sum, power| sum * s + polynomial_at::<false>(power, t));
            (found - made.exact(lens, t, s)).abs() <= error
        };
        grid(60).all(|t| grid(6).all(|s| is_near(t, s))).then_some(made)
    }

    /// The radius over the sine of the direction, at the variables `t` of the direction and `s` of the distance; not a number where the lens
    /// does not see the point.
    fn exact(&self, lens: &KannalaBrandt, t: f64, s: f64) -> f64 {
        let cosine = ((t - self.direction[1]) / self.direction[0]).min(1.0);
        let inverse = ((s - self.distance[1]) / self.distance[0]).max(f64::MIN_POSITIVE.sqrt());
        let sine = (1.0 - cosine * cosine).sqrt();
        if sine == 0.0 {
            return lens.k()[0];
        }
        let seen = lens.pupil().seen(sine / inverse, cosine / inverse);
        seen.map_or(f64::NAN, |seen| lens.series().radius(seen.theta) / sine)
    }
}

/// The polynomial of as few of a Chebyshev series' terms as leave out no more than `error` together.
fn shortened(series: &[f64], error: f64) -> Vec<f64> {
    let mut left_out = 0.0;
    let small = series.iter().rev().take_while(|coefficient| {
        left_out += coefficient.abs();
        left_out <= error
    });
    let terms = series.len() - small.count();
    powers(&series[..terms.max(1)])
}

/// Numbers from -1 to 1.
fn grid(steps: u32) -> impl Iterator<Item = f64> {
    (0..=steps).map(move |step| 2.0 * f64::from(step) / f64::from(steps) - 1.0)
}

impl Kernel<3, 2> for ProjectByPupil {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let (mut inverse, mut t, mut s, mut told) = ([0.0; W], [0.0; W], [0.0; W], [0.0; W]);
        for j in 0..W {
            let across = x[j] * x[j] + y[j] * y[j];
            let squared = fused(z[j], z[j], across);
            // What is no number is asked too.
            let is_known = squared >= self.near_squared && squared <= FAR;
            let squared = if is_known { squared } else { self.near_squared };
            // In half the digits, which takes a fifth of the time, and a step of Newton's method for the other half.
            let rough = f64::from(1.0 / (squared as f32).sqrt());
            inverse[j] = fused(0.5 * rough, fused(-squared * rough, rough, 1.0), rough);
            t[j] = fused(z[j] * inverse[j], self.direction[0], self.direction[1]);
            s[j] = fused(inverse[j], self.distance[0], self.distance[1]);
            let ahead = z[j] - self.end[0];
            let out = if ahead * ahead.abs() >= self.end[1] * across { 0.0 } else { f64::NAN };
            told[j] = if is_known { out } else { ASK };
        }
        let mut scale = [0.0; W];
        for power in self.powers.iter().rev() {
            let of_direction = polynomial::<FUSED, W>(power, &t);
            for j in 0..W {
                scale[j] = fused(scale[j], s[j], of_direction[j]);
            }
        }
        let (mut u, mut v) = ([0.0; W], [0.0; W]);
        for j in 0..W {
            let scale = scale[j] * inverse[j];
            u[j] = if told[j] == ASK { ASK } else { fused(scale, x[j], self.centre[0]) + told[j] };
            v[j] = fused(self.aspect * scale, y[j], self.centre[1]) + told[j];
        }
        [u, v]
    }
}

/// Pixels to rays and the places on the axis where they begin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct UnprojectByPupil {
    lens: Unproject,
    shift: Vec<f64>,
}

impl UnprojectByPupil {
    /// With the polynomials of the lens without its pupil. `None` where none comes near.
    pub(super) fn new(lens: &KannalaBrandt, central: &Unproject) -> Option<Self> {
        /// In millimetres.
        const LARGEST_ERROR: f64 = 1e-9;
        const RADII: u32 = 500;
        let pupil = lens.pupil();
        let shift = |t: f64| pupil.shift_mm(lens.angle(central.radius(t)));
        let fitted = |terms| Self { lens: central.clone(), shift: fit(terms, shift) };
        let is_near =
            |fit: &Self| grid(RADII).all(|t| (polynomial_at::<false>(&fit.shift, t) - shift(t)).abs() <= LARGEST_ERROR);
        (8..=48).step_by(2).map(fitted).find(is_near)
    }
}

impl Kernel<2, 4> for UnprojectByPupil {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, pixels: [[f64; W]; 2]) -> [[f64; W]; 4] {
        let ([x, y, z], t) = self.lens.rays::<FUSED, W>(pixels);
        [x, y, z, polynomial::<FUSED, W>(&self.shift, &t)]
    }
}

over_rows!(project_baseline, project_best, ProjectByPupil, LANES, 3 => 2);
over_rows!(back_baseline, back_best, UnprojectByPupil, LANES_BACK, 2 => 4);

pub(super) fn project_by_pupil(lens: &ProjectByPupil, best: bool, points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>) {
    if best { project_best(lens, points, pixels) } else { project_baseline(lens, points, pixels) }
}

pub(super) fn unproject_by_pupil(lens: &UnprojectByPupil, best: bool, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 4]>) {
    if best { back_best(lens, pixels, rays) } else { back_baseline(lens, pixels, rays) }
}
