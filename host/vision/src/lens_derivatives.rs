//! Derivatives of pixels by rays, of rays by pixels, and of pixels by the lens's parameters.
//!
//! A turn of the ray by one radian moves the pixel by dr/dθ along the radius, and by r / sin θ across it.

use nalgebra::{Matrix2x3, Matrix3x2, RowVector3, SMatrix, Vector2, Vector3};

use crate::{Frame, KannalaBrandt, UnitRay, pupil_shift, pupil_shift_slope};

/// Number of lens parameters. Their order is fx, fy, cx, cy in pixels, then k1 to k4 as defined by OpenCV fisheye, then the pupil's
/// coefficient e0 in millimetres, which moves the origin of a ray and not its direction.
pub const LENS_PARAMETERS: usize = 9;
/// Number of the parameters before e0: those of a central lens.
pub(crate) const CENTRAL_PARAMETERS: usize = 8;
/// Index of e0.
pub(crate) const PUPIL: usize = 8;

/// A lens's local geometry at a ray: the angle θ, the radial and tangential directions in space and in the image, and
/// the resolution along each.
struct Local {
    theta: f64,
    space: [Vector3<f64>; 2],
    image: [Vector2<f64>; 2],
    pixels_per_radian: [f64; 2],
}

/// What changes with a ray, its pixel and its lens.
pub(crate) struct RayDerivatives {
    /// As [`KannalaBrandt::ray_by_pixel`].
    pub ray_by_pixel: Matrix3x2<f64>,
    /// As [`KannalaBrandt::pixel_by_lens`].
    pub pixel_by_lens: SMatrix<f64, 2, LENS_PARAMETERS>,
    /// Movement of the ray's origin along the axis by its unit vector, in mm.
    pub origin_by_ray: RowVector3<f64>,
    /// The same by the lens's e0.
    pub origin_by_pupil: f64,
}

impl KannalaBrandt {
    /// The derivative of the pixel by the unit vector of `ray`, in pixels per radian.
    #[must_use]
    pub fn pixel_by_ray<F: Frame>(&self, ray: &UnitRay<F>) -> Matrix2x3<f64> {
        let Local { space, image, pixels_per_radian, .. } = self.local(ray);
        let along = |i: usize| image[i] * space[i].transpose() * pixels_per_radian[i];
        let mut derivative = along(0) + along(1);
        derivative.row_mut(1).scale_mut(self.aspect());
        derivative
    }

    /// The derivative of the unit vector of `ray` by its pixel, in radians per pixel.
    #[must_use]
    pub fn ray_by_pixel<F: Frame>(&self, ray: &UnitRay<F>) -> Matrix3x2<f64> {
        self.local(ray).ray_by_pixel(self)
    }

    /// The derivative of the pixel of `ray`, whose direction stays, by the lens's parameters, in the order of [`LENS_PARAMETERS`].
    #[must_use]
    pub fn pixel_by_lens<F: Frame>(&self, ray: &UnitRay<F>) -> SMatrix<f64, 2, LENS_PARAMETERS> {
        self.local(ray).pixel_by_lens(self)
    }

    /// All derivatives at `ray`, at little more than the cost of one.
    pub(crate) fn derivatives<F: Frame>(&self, ray: &UnitRay<F>) -> RayDerivatives {
        let local = self.local(ray);
        RayDerivatives {
            ray_by_pixel: local.ray_by_pixel(self),
            pixel_by_lens: local.pixel_by_lens(self),
            origin_by_ray: local.space[0].transpose() * (self.pupil_mm() * pupil_shift_slope(local.theta)),
            origin_by_pupil: pupil_shift(local.theta),
        }
    }

    fn local<F: Frame>(&self, ray: &UnitRay<F>) -> Local {
        let d = ray.vector();
        let sine = d.x.hypot(d.y);
        let theta = sine.atan2(d.z);
        // On the axis every radial direction is equivalent.
        let (cos_phi, sin_phi) = if sine > 0.0 { (d.x / sine, d.y / sine) } else { (1.0, 0.0) };
        let across = if sine > 0.0 { self.radius_at(theta) / sine } else { self.k()[0] };
        Local {
            theta,
            space: [Vector3::new(d.z * cos_phi, d.z * sin_phi, -sine), Vector3::new(-sin_phi, cos_phi, 0.0)],
            image: [Vector2::new(cos_phi, sin_phi), Vector2::new(-sin_phi, cos_phi)],
            pixels_per_radian: [self.pixels_per_radian(crate::Angle::from_rad(theta)), across],
        }
    }
}

impl Local {
    fn ray_by_pixel(&self, lens: &KannalaBrandt) -> Matrix3x2<f64> {
        let along = |i: usize| self.space[i] * self.image[i].transpose() / self.pixels_per_radian[i];
        let mut derivative = along(0) + along(1);
        derivative.column_mut(1).unscale_mut(lens.aspect());
        derivative
    }

    fn pixel_by_lens(&self, lens: &KannalaBrandt) -> SMatrix<f64, 2, LENS_PARAMETERS> {
        let [fx, fy] = [lens.k()[0], lens.k()[0] * lens.aspect()];
        let [radial, _] = self.image;
        pixel_by_lens([fx, fy], self.theta, lens.radius_at(self.theta) / fx, radial.into())
    }
}

/// The derivative of a pixel by the lens's parameters: focal lengths in pixels, the angle from the axis, the radius in focal lengths,
/// and the direction from the axis in the image.
pub(crate) fn pixel_by_lens(
    [fx, fy]: [f64; 2],
    theta: f64,
    distorted: f64,
    [cosine, sine]: [f64; 2],
) -> SMatrix<f64, 2, LENS_PARAMETERS> {
    let mut columns = SMatrix::zeros();
    columns[(0, 0)] = distorted * cosine;
    columns[(1, 1)] = distorted * sine;
    columns[(0, 2)] = 1.0;
    columns[(1, 3)] = 1.0;
    let (mut power, squared) = (theta, theta * theta);
    for column in 4..CENTRAL_PARAMETERS {
        power *= squared;
        columns[(0, column)] = fx * power * cosine;
        columns[(1, column)] = fy * power * sine;
    }
    columns
}
