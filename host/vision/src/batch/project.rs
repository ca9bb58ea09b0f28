//! Projection of whole arrays of points to pixels.

use super::arc_tangent::distance_and_angle;
use super::lanes::{Kernel, over_rows, polynomial};
use crate::KannalaBrandt;

/// Rows per step. Fewer are slower: the three columns of a row-major array are read best in long runs.
const LANES: usize = 32;

/// The parameters of a lens that projection needs, with so many coefficients of the radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Project<const TERMS: usize> {
    k: [f64; TERMS],
    aspect: f64,
    centre: [f64; 2],
    theta_max: f64,
}

impl<const TERMS: usize> Project<TERMS> {
    pub(super) fn new(lens: &KannalaBrandt, k: [f64; TERMS]) -> Self {
        let centre = lens.centre();
        Self { k, aspect: lens.aspect(), centre: [centre.u, centre.v], theta_max: lens.theta_max().rad() }
    }
}

impl<const TERMS: usize> Kernel<3, 2> for Project<TERMS> {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let (rho, theta) = distance_and_angle::<FUSED, W>(&[x, y, z]);
        let mut squared = [0.0; W];
        for j in 0..W {
            squared[j] = theta[j] * theta[j];
        }
        let growth = polynomial::<FUSED, W>(&self.k, &squared);
        let scale = scales(&rho, &theta, &growth, self.theta_max);
        pixels([x, y], scale, self.centre, self.aspect)
    }
}

/// Pixels over the distance from the axis, for the angles to it and the radii over the angles; not numbers beyond the field.
#[inline(always)]
pub(super) fn scales<const W: usize>(rho: &[f64; W], theta: &[f64; W], growth: &[f64; W], theta_max: f64) -> [f64; W] {
    let mut scales = [0.0; W];
    for j in 0..W {
        // On the axis x and y are zero, whatever the scale.
        let scale = theta[j] * growth[j] / if rho[j] > 0.0 { rho[j] } else { 1.0 };
        let seen = theta[j] <= theta_max && rho[j] < f64::INFINITY;
        scales[j] = if seen { scale } else { f64::NAN };
    }
    scales
}

/// The pixels of places across the axis.
#[inline(always)]
pub(super) fn pixels<const W: usize>(
    [x, y]: [[f64; W]; 2],
    scale: [f64; W],
    centre: [f64; 2],
    aspect: f64,
) -> [[f64; W]; 2] {
    let (mut u, mut v) = ([0.0; W], [0.0; W]);
    for j in 0..W {
        u[j] = centre[0] + scale[j] * x[j];
        v[j] = centre[1] + aspect * scale[j] * y[j];
    }
    [u, v]
}

over_rows!(project_baseline, project_best, Project<5>, LANES, 3 => 2);
over_rows!(further_baseline, further_best, Project<{ crate::radial_series::TERMS }>, LANES, 3 => 2);
