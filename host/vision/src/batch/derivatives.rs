//! Projection of whole arrays of points with the derivatives of their pixels.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use nalgebra::{Matrix2x3, SMatrix, Vector2, Vector3};

use super::arc_tangent::distance_and_angle;
use super::lanes::{ALWAYS_FUSED, Kernel, for_rows, polynomial};
use crate::lens_derivatives::pixel_by_lens;
use crate::{Asymmetry, Camera, KannalaBrandt, LENS_PARAMETERS, Pixel, UnitRay};

/// Numbers of a row: the pixel, its derivatives by the point, and what those by the lens consist of.
const NUMBERS: usize = 12;
/// Rows per step: with more, the columns do not fit the registers and the first cache.
const LANES: usize = 16;

/// The parameters of a lens that projection with derivatives needs, with so many coefficients of the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Derivatives<const TERMS: usize> {
    k: [f64; TERMS],
    /// The factors of dr/dθ: (2 i + 1) k_i.
    slope: [f64; TERMS],
    aspect: f64,
    centre: [f64; 2],
    theta_max: f64,
    asymmetry: Asymmetry,
}

/// Pixels of many points with their derivatives, by index of the point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProjectedPoints {
    rows: Vec<[f64; NUMBERS]>,
    focal_lengths: [f64; 2],
    asymmetry: Asymmetry,
}

impl ProjectedPoints {
    /// Puts pixels and derivatives by the points of a lens of another model in the place of those of its polynomial.
    pub(super) fn make_foreign(&mut self, lens: &KannalaBrandt, points: &[[f64; 3]]) {
        for (row, point) in self.rows.iter_mut().zip(points) {
            let at = Vector3::from(*point);
            let seen =
                UnitRay::<Camera>::new(at).and_then(|ray| Some((lens.project(&ray).ok()?, lens.pixel_by_ray(&ray))));
            let Some((pixel, by_ray)) = seen else {
                row.fill(f64::NAN);
                continue;
            };
            let by_point = by_ray / at.norm();
            (row[0], row[1]) = (pixel.u, pixel.v);
            for axis in 0..3 {
                (row[2 + axis], row[5 + axis]) = (by_point[(0, axis)], by_point[(1, axis)]);
            }
        }
    }

    /// Number of points.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The pixel of a point; NaN outside the field. `None` beyond the last point.
    #[must_use]
    pub fn pixel(&self, index: usize) -> Option<Pixel> {
        self.rows.get(index).map(|&[u, v, ..]| Pixel { u, v })
    }

    /// The derivative of the pixel by the point, in pixels per unit of the point.
    #[must_use]
    pub fn by_point(&self, index: usize) -> Option<Matrix2x3<f64>> {
        self.rows.get(index).map(|row| Matrix2x3::from_row_slice(&row[2..8]))
    }

    /// The derivative of the pixel by the lens's parameters, in the order of [`LENS_PARAMETERS`].
    #[must_use]
    pub fn by_lens(&self, index: usize) -> Option<SMatrix<f64, 2, LENS_PARAMETERS>> {
        let &[.., cosine, sine, theta, distorted] = self.rows.get(index)?;
        Some(pixel_by_lens(self.focal_lengths, theta, distorted, [cosine, sine], &self.asymmetry))
    }
}

impl<const TERMS: usize> Derivatives<TERMS> {
    pub(super) fn new(lens: &KannalaBrandt, k: [f64; TERMS]) -> Self {
        let centre = lens.centre();
        let mut slope = k;
        for (i, factor) in slope.iter_mut().enumerate() {
            *factor *= (2 * i + 1) as f64;
        }
        let (centre, theta_max) = ([centre.u, centre.v], lens.theta_max().rad());
        Self { k, slope, aspect: lens.aspect(), centre, theta_max, asymmetry: lens.asymmetry() }
    }

    pub(super) fn of(&self, points: &[[f64; 3]], best: bool, out: &mut ProjectedPoints) {
        out.rows.clear();
        out.focal_lengths = [self.k[0], self.k[0] * self.aspect];
        out.asymmetry = self.asymmetry;
        if best {
            derive_best(self, points, &mut out.rows);
        } else {
            for_rows::<ALWAYS_FUSED, LANES, 3, NUMBERS>(self, points, &mut out.rows);
        }
        if !self.asymmetry.is_zero() {
            out.rows.iter_mut().for_each(|row| self.displace(row));
        }
    }

    /// Makes the row of a symmetric lens that of this one.
    fn displace(&self, row: &mut [f64; NUMBERS]) {
        let [f, aspect] = [self.k[0], self.aspect];
        let [.., cosine, sine, _, distorted] = *row;
        let place = Vector2::new(distorted * cosine, distorted * sine);
        let (arrived, bend) = (self.asymmetry.moved(place) * f, self.asymmetry.by_place(place));
        (row[0], row[1]) = (self.centre[0] + arrived.x, self.centre[1] + aspect * arrived.y);
        for axis in 2..5 {
            let by = bend * Vector2::new(row[axis], row[axis + 3] / aspect);
            (row[axis], row[axis + 3]) = (by.x, by.y * aspect);
        }
    }
}

impl<const TERMS: usize> Kernel<3, NUMBERS> for Derivatives<TERMS> {
    /// With the radius r(θ), the unit vector (c, s) from the axis to the point and R² = x² + y² + z²: u = cx + r c, and
    /// dθ = (z dρ − ρ dz) / R².
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; NUMBERS] {
        let (rho, theta) = distance_and_angle::<FUSED, W>(&[x, y, z]);
        let mut squared = [0.0; W];
        for j in 0..W {
            squared[j] = theta[j] * theta[j];
        }
        let growth = polynomial::<FUSED, W>(&self.k, &squared);
        let slope = polynomial::<FUSED, W>(&self.slope, &squared);
        let mut out = [[0.0; W]; NUMBERS];
        for j in 0..W {
            let on_axis = rho[j] == 0.0;
            let over_rho = 1.0 / if on_axis { 1.0 } else { rho[j] };
            // On the axis every direction away from it is equivalent.
            let (c, s) = (if on_axis { 1.0 } else { x[j] * over_rho }, y[j] * over_rho);
            let nearness = 1.0 / (rho[j] * rho[j] + z[j] * z[j]);
            let seen = theta[j] <= self.theta_max && rho[j] < f64::INFINITY;
            let radius = if seen { theta[j] * growth[j] } else { f64::NAN };
            // The pixel's movement along the radius and across it, for a step of the point in the plane of the image.
            let along = slope[j] * z[j] * nearness;
            let across = if on_axis { along } else { radius * over_rho };
            let away = -slope[j] * rho[j] * nearness;
            let mixed = (along - across) * c * s;
            out[0][j] = self.centre[0] + radius * c;
            out[1][j] = self.centre[1] + self.aspect * radius * s;
            out[2][j] = along * c * c + across * s * s;
            out[3][j] = mixed;
            out[4][j] = away * c;
            out[5][j] = self.aspect * mixed;
            out[6][j] = self.aspect * (along * s * s + across * c * c);
            out[7][j] = self.aspect * away * s;
            out[8][j] = c;
            out[9][j] = s;
            out[10][j] = theta[j];
            out[11][j] = radius / self.k[0];
        }
        out
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn derive_best<const TERMS: usize>(lens: &Derivatives<TERMS>, points: &[[f64; 3]], rows: &mut Vec<[f64; NUMBERS]>) {
    if target_cfg_f!(target_feature = "fma") {
        for_rows::<true, LANES, 3, NUMBERS>(lens, points, rows);
    } else {
        for_rows::<ALWAYS_FUSED, LANES, 3, NUMBERS>(lens, points, rows);
    }
}
