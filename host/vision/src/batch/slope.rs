//! How a camera sees a point, row by row: see [`crate::lens_derivatives`].

use nalgebra::Vector3;

use super::arc_tangent::angle_from_axis;
use super::lanes::{multiply_add, polynomial_at};
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
pub(super) type InImage = [f64; 2];

/// How a camera sees a point.
pub(super) struct View {
    /// θ cos φ and θ sin φ, with φ the direction from the axis in the image.
    pub place: InImage,
    /// θ².
    pub squared: f64,
    /// The radius over θ, in pixels.
    pub growth: f64,
    /// The turn of the ray in the epipolar plane, then across it, in radians per pixel.
    pub turns: [InImage; 2],
}

impl LensSlope {
    pub(super) fn new(lens: &KannalaBrandt) -> Self {
        let k = lens.k();
        let derivative = std::array::from_fn(|i| (2 * i + 1) as f64 * k[i]);
        Self { k, derivative, per_focal: 1.0 / k[0] }
    }

    /// How the camera sees the point `at` at one over `per_range`, in its own frame. `normal` is the unit normal of the epipolar plane.
    ///
    /// With e the direction in which the ray moves as θ grows, f that as φ grows, and the normal n = p e + q f, a ray that moves by (τ, τ')
    /// along both turns by q τ - p τ' in the plane, along n × u, and by p τ + q τ' across it, along n.
    #[inline(always)]
    pub(super) fn at<const FUSED: bool>(&self, at: &Vector3<f64>, per_range: f64, normal: &Vector3<f64>) -> View {
        let fused = multiply_add::<FUSED>;
        let rho = fused(at.x, at.x, at.y * at.y).sqrt();
        let [theta] = angle_from_axis::<FUSED, 1>(&[rho], &[at.z]);
        let squared = theta * theta;
        let (growth, slope) =
            (polynomial_at::<FUSED>(&self.k, squared), polynomial_at::<FUSED>(&self.derivative, squared));
        // On the axis every radial direction is equivalent.
        let on_axis = rho <= 0.0;
        let per_rho = 1.0 / if on_axis { 1.0 } else { rho };
        let (cosine, sine) = (if on_axis { 1.0 } else { at.x * per_rho }, at.y * per_rho);
        // Radians per pixel along the radius, and across it, by one division.
        let radius = if on_axis { 1.0 } else { theta * growth };
        let per_both = 1.0 / (slope * radius);
        let along = radius * per_both;
        let across = if on_axis { self.per_focal } else { rho * per_range * (slope * per_both) };
        let outward = fused(normal.x, cosine, normal.y * sine);
        let p = fused(outward, at.z, -(normal.z * rho)) * per_range;
        let q = fused(normal.y, cosine, -(normal.x * sine));
        let (p_along, q_along, p_across, q_across) = (p * along, q * along, p * across, q * across);
        let in_plane = [fused(q_along, cosine, p_across * sine), fused(q_along, sine, -(p_across * cosine))];
        let across_it = [fused(p_along, cosine, -(q_across * sine)), fused(p_along, sine, q_across * cosine)];
        View { place: [theta * cosine, theta * sine], squared, growth, turns: [in_plane, across_it] }
    }
}
