//! How a camera sees a point, for every lane: see [`crate::lens_derivatives`].

use super::arc_tangent::angle_from_axis;
use super::lanes::{multiply_add, polynomial};
use super::vectors::Vectors;
use crate::KannalaBrandt;

/// The parameters of a lens that its derivatives need.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LensSlope {
    k: [f64; 5],
    /// Coefficients of dr/dθ in θ².
    derivative: [f64; 5],
    per_focal: f64,
}

/// A number for each coordinate of an image. The coordinate v is divided by the lens's aspect, so that both have one scale.
pub(super) type InImage<const W: usize> = [[f64; W]; 2];

/// How a camera sees one point per lane.
pub(super) struct View<const W: usize> {
    /// θ cos φ and θ sin φ, with φ the direction from the axis in the image.
    pub place: InImage<W>,
    /// θ².
    pub squared: [f64; W],
    /// The radius over θ, in pixels.
    pub growth: [f64; W],
    /// The turn of the ray in the epipolar plane, then across it, in radians per pixel.
    pub turns: [InImage<W>; 2],
}

impl LensSlope {
    pub(super) fn new(lens: &KannalaBrandt) -> Self {
        let k = lens.k();
        let derivative = std::array::from_fn(|i| (2 * i + 1) as f64 * k[i]);
        Self { k, derivative, per_focal: 1.0 / k[0] }
    }

    /// How the camera sees the points (x, y, z) at one over `per_range`, in its own frame. `normal` is the unit normal of the
    /// epipolar plane.
    ///
    /// With e the direction in which the ray moves as θ grows, f that as φ grows, and the normal n = p e + q f, a ray that moves by (τ, τ')
    /// along both turns by q τ - p τ' in the plane, along n × u, and by p τ + q τ' across it, along n.
    #[inline(always)]
    pub(super) fn at<const FUSED: bool, const W: usize>(
        &self,
        [x, y, z]: &Vectors<W>,
        per_range: &[f64; W],
        [nx, ny, nz]: &Vectors<W>,
    ) -> View<W> {
        let mut rho = [0.0; W];
        for j in 0..W {
            rho[j] = multiply_add::<FUSED>(x[j], x[j], y[j] * y[j]).sqrt();
        }
        let theta = angle_from_axis::<FUSED, W>(&rho, z);
        let mut squared = [0.0; W];
        for j in 0..W {
            squared[j] = theta[j] * theta[j];
        }
        let growth = polynomial::<FUSED, W>(&self.k, &squared);
        let slope = polynomial::<FUSED, W>(&self.derivative, &squared);
        let (mut place, mut turns) = ([[0.0; W]; 2], [[[0.0; W]; 2]; 2]);
        for j in 0..W {
            // On the axis every radial direction is equivalent.
            let on_axis = rho[j] <= 0.0;
            let per_rho = 1.0 / if on_axis { 1.0 } else { rho[j] };
            let (cosine, sine) = (if on_axis { 1.0 } else { x[j] * per_rho }, y[j] * per_rho);
            // Radians per pixel along the radius, and across it.
            let along = 1.0 / slope[j];
            let across = rho[j] * per_range[j] / (theta[j] * growth[j]);
            let across = if on_axis { self.per_focal } else { across };
            let outward = multiply_add::<FUSED>(nx[j], cosine, ny[j] * sine);
            let p = multiply_add::<FUSED>(outward, z[j], -(nz[j] * rho[j])) * per_range[j];
            let q = multiply_add::<FUSED>(ny[j], cosine, -(nx[j] * sine));
            let (p_along, q_along, p_across, q_across) = (p * along, q * along, p * across, q * across);
            turns[0][0][j] = multiply_add::<FUSED>(q_along, cosine, p_across * sine);
            turns[0][1][j] = multiply_add::<FUSED>(q_along, sine, -(p_across * cosine));
            turns[1][0][j] = multiply_add::<FUSED>(p_along, cosine, -(q_across * sine));
            turns[1][1][j] = multiply_add::<FUSED>(p_along, sine, q_across * cosine);
            (place[0][j], place[1][j]) = (theta[j] * cosine, theta[j] * sine);
        }
        View { place, squared, growth, turns }
    }
}
