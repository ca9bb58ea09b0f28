//! Points of whole arrays to pixels by the splined stereographic model.
//!
//! The surface that is prepared has the pixels themselves, not the shifts: a B-spline is every linear function of the place if its control points are,
//! and so are the stereographic image and the map to pixels.

use super::lanes::{Kernel, multiply_add, over_rows};
use super::stepwise::{ASK, RIM};
use super::surface::Surface;
use crate::{SplineGrid, SplinedStereographic};

/// Rows per step.
const LANES: usize = 64;
/// So near to an edge of the surface, in its intervals, the model itself is asked.
pub(super) const EDGE: f64 = 1e-9;

/// A splined lens, prepared.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splined {
    /// Pixels over places of the stereographic image.
    pub surface: Surface,
    /// Intervals of the surface in a unit of that image, and the place of its middle.
    pub per_unit: f64,
    pub middle: [f64; 2],
    /// The pixel of the middle before the surface moves it, and the pixels of an interval.
    pub pixel: [f64; 2],
    pub scale: [f64; 2],
    /// The cosine of the angle at the end of the field.
    pub end: f64,
}

impl Splined {
    /// Of the lens with this model and this affine map to pixels, which has no skew.
    pub(super) fn new(model: &SplinedStereographic, affine: [[f64; 3]; 2], theta_max: f64) -> Self {
        let (SplineGrid { order, columns, rows, .. }, per_unit) = (model.grid, model.grid.intervals_per_unit());
        let [[fx, _, cx], [_, fy, cy]] = affine;
        let middle = [columns, rows].map(|count| 0.5 * (count as f64 - 1.0));
        let pixel_of = |(index, shift): (usize, &[f64; 2])| {
            let place = [index % columns.max(1), index / columns.max(1)];
            let image = |axis: usize| (place[axis] as f64 - middle[axis]) / per_unit + shift[axis];
            [fx * image(0) + cx, fy * image(1) + cy]
        };
        let control: Vec<[f64; 2]> = model.control.iter().enumerate().map(pixel_of).collect();
        Self {
            surface: Surface::new(order, [columns, rows], &control),
            per_unit,
            middle,
            pixel: [cx, cy],
            scale: [fx / per_unit, fy / per_unit],
            end: theta_max.cos(),
        }
    }
}

impl Kernel<3, 2> for Splined {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let (mut place, mut told) = ([[0.0; W]; 2], [0.0; W]);
        for j in 0..W {
            let norm = fused(x[j], x[j], fused(y[j], y[j], z[j] * z[j])).sqrt();
            // The origin has no direction: no number.
            let over = 2.0 * self.per_unit / (norm + z[j]);
            place[0][j] = fused(x[j], over, self.middle[0]);
            place[1][j] = fused(y[j], over, self.middle[1]);
            let (above_end, near) = (fused(-self.end, norm, z[j]), RIM * norm);
            let out = if above_end > near { 0.0 } else { f64::NAN };
            told[j] = if above_end.abs() <= near { ASK } else { out };
        }
        let inside = self.surface.inside::<W>(&place);
        let mut pixels = self.surface.values::<FUSED, W>(&self.surface.located::<FUSED, W>(&place));
        for j in 0..W {
            let out = if inside[j] > EDGE { 0.0 } else { f64::NAN };
            told[j] += if inside[j].abs() <= EDGE { ASK } else { out };
            // Zero where something is told, not a number where not.
            pixels[0][j] += told[j];
            pixels[1][j] += told[j];
        }
        pixels
    }
}

over_rows!(splined_baseline, splined_best, Splined, LANES, 3 => 2);
