//! Camera models as the steps from a ray to its pixel, by which arrays are computed.
//!
//! A ray goes onto a plane, is distorted there, and an affine map makes the pixel. Models whose steps are not these are computed in other ways.

use super::{OCam, Radtan, SplinedStereographic};

/// A camera model as steps.
#[derive(Clone, Debug, PartialEq)]
pub struct LensSteps {
    pub(crate) onto_plane: OntoPlane,
    pub(crate) distortion: Radtan,
    /// What u and v are of (x, y, 1).
    pub(crate) affine: [[f64; 3]; 2],
}

/// How rays meet the plane.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum OntoPlane {
    /// By a pinhole at this distance behind the centre of the unit sphere, on the plane at the distance one from the pinhole.
    Sphere(f64),
    /// At a radius that depends on the angle to the axis.
    Angle(AngleLaw),
    /// Stereographically, where the surface of a spline moves places.
    Stereographic(SplinedStereographic),
}

/// The radius by the angle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum AngleLaw {
    /// θ (1 + k0 θ² + k1 θ⁴ + ..).
    Series([f64; 6]),
    /// That of OCamCalib, in pixels.
    OCam(OCam),
}

impl AngleLaw {
    pub(crate) fn radius(&self, theta: f64) -> f64 {
        match self {
            Self::Series(k) => theta * (1.0 + k.iter().rev().fold(0.0, |sum, k| (sum + k) * (theta * theta))),
            Self::OCam(camera) => camera.radius(theta),
        }
    }

    /// The angle at `radius`, no larger than `most`, up to which the radius grows.
    pub(crate) fn angle(&self, radius: f64, most: f64) -> f64 {
        const STEPS: usize = 100;
        match self {
            Self::Series(k) => {
                let slope = |theta: f64| {
                    let squared = theta * theta;
                    let term = |(n, k): (usize, &f64)| (2 * n + 3) as f64 * k;
                    1.0 + k.iter().enumerate().rev().fold(0.0, |sum, each| (sum + term(each)) * squared)
                };
                let ([mut low, mut high], mut theta) = ([0.0, most], radius.min(most));
                for _ in 0..STEPS {
                    let missing = radius - self.radius(theta);
                    if missing > 0.0 {
                        low = theta;
                    } else {
                        high = theta;
                    }
                    let newton = theta + missing / slope(theta);
                    let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
                    let step = (next - theta).abs();
                    theta = next;
                    if step <= f64::EPSILON {
                        break;
                    }
                }
                theta
            }
            Self::OCam(camera) => camera.angle(radius).min(most),
        }
    }
}

impl LensSteps {
    /// The steps with `pinhole` fx, fy, cx, cy, and `skew` in pixels.
    pub(super) fn new(onto_plane: OntoPlane, distortion: Radtan, [fx, fy, cx, cy]: [f64; 4], skew: f64) -> Self {
        Self { onto_plane, distortion, affine: [[fx, skew, cx], [0.0, fy, cy]] }
    }

    /// The steps to the pixels of a sensor with `scale` pixels for each. Pixel centres are whole numbers, so the sensor's corner is at
    /// (-1/2, -1/2).
    pub(crate) fn resampled(mut self, scale: f64) -> Self {
        for [by_x, by_y, shift] in &mut self.affine {
            [*by_x, *by_y, *shift] = [*by_x * scale, *by_y * scale, (*shift + 0.5) * scale - 0.5];
        }
        self
    }
}
