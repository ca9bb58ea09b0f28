//! Derivatives of rays by pixels and by lens parameters, for every lane: see [`crate::lens_derivatives`].

use super::arc_tangent::angle_from_axis;
use super::lanes::{multiply_add, polynomial};
use super::vectors::Vectors;
use crate::KannalaBrandt;
use crate::lens_derivatives::LENS_PARAMETERS;

/// The parameters of a lens that its derivatives need.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LensSlope {
    k: [f64; 5],
    /// Coefficients of dr/dθ in θ².
    derivative: [f64; 5],
    aspect: f64,
}

impl LensSlope {
    pub(super) fn new(lens: &KannalaBrandt) -> Self {
        let k = lens.k();
        let derivative = std::array::from_fn(|i| (2 * i + 1) as f64 * k[i]);
        Self { k, derivative, aspect: lens.aspect() }
    }

    /// The lens's local geometry at unit rays in the camera's frame.
    #[inline(always)]
    pub(super) fn at<const FUSED: bool, const W: usize>(&self, [x, y, z]: &Vectors<W>) -> Slope<W> {
        let mut sine = [0.0; W];
        for j in 0..W {
            sine[j] = multiply_add::<FUSED>(x[j], x[j], y[j] * y[j]).sqrt();
        }
        let theta = angle_from_axis::<FUSED, W>(&sine, z);
        let mut squared = [0.0; W];
        for j in 0..W {
            squared[j] = theta[j] * theta[j];
        }
        let growth = polynomial::<FUSED, W>(&self.k, &squared);
        let slope = polynomial::<FUSED, W>(&self.derivative, &squared);
        let mut out = Slope {
            focal: self.k[0],
            per_aspect: 1.0 / self.aspect,
            theta,
            cos_phi: [0.0; W],
            sin_phi: [0.0; W],
            sine,
            cosine: *z,
            distorted: [0.0; W],
            per_radial: [0.0; W],
            per_across: [0.0; W],
        };
        for j in 0..W {
            // On the axis every radial direction is equivalent.
            let on_axis = sine[j] <= 0.0;
            let per_sine = 1.0 / if on_axis { 1.0 } else { sine[j] };
            out.cos_phi[j] = if on_axis { 1.0 } else { x[j] * per_sine };
            out.sin_phi[j] = y[j] * per_sine;
            let radius = theta[j] * growth[j];
            out.distorted[j] = radius / self.k[0];
            out.per_radial[j] = 1.0 / slope[j];
            out.per_across[j] = if on_axis { 1.0 / self.k[0] } else { sine[j] / radius };
        }
        out
    }
}

/// A lens's local geometry at one ray per lane.
pub(super) struct Slope<const W: usize> {
    focal: f64,
    per_aspect: f64,
    theta: [f64; W],
    cos_phi: [f64; W],
    sin_phi: [f64; W],
    sine: [f64; W],
    cosine: [f64; W],
    /// The radius over the focal length.
    distorted: [f64; W],
    /// Radians per pixel along the radius.
    per_radial: [f64; W],
    /// Radians per pixel across the radius.
    per_across: [f64; W],
}

/// The derivatives of a number that depends on a ray: by the ray's pixel, and at a fixed pixel by the lens's
/// parameters.
pub(super) struct Gradient<const W: usize> {
    pub by_pixel: [[f64; W]; 2],
    pub by_lens: [[f64; W]; LENS_PARAMETERS],
}

impl<const W: usize> Slope<W> {
    /// The derivatives of a number that changes by `gradient` · dray.
    #[inline(always)]
    pub(super) fn along<const FUSED: bool>(&self, [gx, gy, gz]: &Vectors<W>) -> Gradient<W> {
        let mut out = Gradient { by_pixel: [[0.0; W]; 2], by_lens: [[0.0; W]; LENS_PARAMETERS] };
        for j in 0..W {
            let (cosine, sine) = (self.cos_phi[j], self.sin_phi[j]);
            let outward = multiply_add::<FUSED>(gx[j], cosine, gy[j] * sine);
            let inclined = multiply_add::<FUSED>(outward, self.cosine[j], -(gz[j] * self.sine[j]));
            let radial = inclined * self.per_radial[j];
            let across = multiply_add::<FUSED>(gy[j], cosine, -(gx[j] * sine)) * self.per_across[j];
            let u = multiply_add::<FUSED>(radial, cosine, -(across * sine));
            let v = multiply_add::<FUSED>(radial, sine, across * cosine) * self.per_aspect;
            (out.by_pixel[0][j], out.by_pixel[1][j]) = (u, v);
            out.by_lens[0][j] = -u * self.distorted[j] * cosine;
            out.by_lens[1][j] = -v * self.distorted[j] * sine;
            out.by_lens[2][j] = -u;
            out.by_lens[3][j] = -v;
            let squared = self.theta[j] * self.theta[j];
            let mut power = -radial * self.focal * self.theta[j];
            for by_k in &mut out.by_lens[4..] {
                power *= squared;
                by_k[j] = power;
            }
        }
        out
    }
}
