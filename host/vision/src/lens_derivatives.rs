//! Derivatives of pixels by rays, of rays by pixels, and of pixels by the lens's parameters.
//!
//! A turn of the ray by one radian moves the pixel by dr/dθ along the radius, and by r / sin θ across it. Where the lens is not symmetric, the
//! derivative of [`crate::Asymmetry`] comes on top.

use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, RowVector3, SMatrix, Vector2, Vector3};

use crate::{Angle, Asymmetry, Frame, KannalaBrandt, Pupil, UnitRay};

/// Number of lens parameters. Their order is that of [`LENS_PARAMETER_NAMES`]: fx, fy, cx, cy in pixels, then k1 to k4 as defined by OpenCV
/// fisheye, then the pupil's coefficients e0 and e1 in millimetres ([`Pupil`]), which move the origin of a ray and not its direction, then
/// p1, p2 and s0 to s3 of [`Asymmetry`], then k5 and k6 of [`KannalaBrandt::further_terms`], then p3 and p4 of the asymmetry.
pub const LENS_PARAMETERS: usize = 20;
/// Names of the lens parameters in files, in their order.
pub const LENS_PARAMETER_NAMES: [&str; LENS_PARAMETERS] = [
    "fx",
    "fy",
    "cx",
    "cy",
    "opencv_k1",
    "opencv_k2",
    "opencv_k3",
    "opencv_k4",
    "pupil_e0_mm",
    "pupil_e1_mm",
    "tangential_p1",
    "tangential_p2",
    "prism_s0",
    "prism_s1",
    "prism_s2",
    "prism_s3",
    "radial_k5",
    "radial_k6",
    "tangential_p3",
    "tangential_p4",
];
/// Number of the parameters before e0: those of a central, symmetric lens.
pub const CENTRAL_PARAMETERS: usize = 8;
/// Indices of e0 and e1.
pub(crate) const PUPIL: [usize; 2] = [8, 9];
/// Indices of the coefficients of the asymmetry, in the order of [`Asymmetry::to_array`].
const ASYMMETRIC: [usize; 8] = [10, 11, 12, 13, 14, 15, 18, 19];
/// Indices of k5 and k6.
const FURTHER: [usize; 2] = [16, 17];

/// A lens's local geometry at a ray: the angle θ, the radial and tangential directions in space and in the image, and
/// the resolution along each.
struct Local {
    theta: f64,
    space: [Vector3<f64>; 2],
    image: [Vector2<f64>; 2],
    pixels_per_radian: [f64; 2],
    /// The derivative of the asymmetry; `None` of a symmetric lens.
    bend: Option<Matrix2<f64>>,
}

/// What changes with a ray, its pixel and its lens.
pub(crate) struct RayDerivatives {
    /// Where the ray starts, in mm.
    pub origin: Vector3<f64>,
    /// As [`KannalaBrandt::ray_by_pixel`].
    pub ray_by_pixel: Matrix3x2<f64>,
    /// As [`KannalaBrandt::pixel_by_lens`].
    pub pixel_by_lens: SMatrix<f64, 2, LENS_PARAMETERS>,
    /// Movement of the ray's origin along the axis by its unit vector, in mm.
    pub origin_by_ray: RowVector3<f64>,
    /// The same by the lens's e0 and e1.
    pub origin_by_pupil: [f64; 2],
}

impl KannalaBrandt {
    /// The derivative of the pixel by the unit vector of `ray`, in pixels per radian.
    #[must_use]
    pub fn pixel_by_ray<F: Frame>(&self, ray: &UnitRay<F>) -> Matrix2x3<f64> {
        if let Some(derivative) = self.foreign_model().and_then(|model| model.pixel_by_ray(ray)) {
            return derivative;
        }
        let Local { space, image, pixels_per_radian, bend, .. } = self.local(ray);
        let along = |i: usize| image[i] * space[i].transpose() * pixels_per_radian[i];
        let mut derivative = along(0) + along(1);
        if let Some(bend) = bend {
            derivative = bend * derivative;
        }
        derivative.row_mut(1).scale_mut(self.aspect());
        derivative
    }

    /// The derivative of the unit vector of `ray` by its pixel, in radians per pixel.
    #[must_use]
    pub fn ray_by_pixel<F: Frame>(&self, ray: &UnitRay<F>) -> Matrix3x2<f64> {
        self.foreign_ray_by_pixel(ray).unwrap_or_else(|| self.polynomial_ray_by_pixel(ray))
    }

    /// [`Self::ray_by_pixel`] of the polynomial, of a lens that is computed by another model too.
    pub(crate) fn polynomial_ray_by_pixel<F: Frame>(&self, ray: &UnitRay<F>) -> Matrix3x2<f64> {
        self.local(ray).ray_by_pixel(self)
    }

    fn foreign_ray_by_pixel<F: Frame>(&self, ray: &UnitRay<F>) -> Option<Matrix3x2<f64>> {
        self.foreign_model().and_then(|model| model.ray_by_pixel(ray))
    }

    /// The derivative of the pixel of `ray`, whose direction stays, by the lens's parameters, in the order of [`LENS_PARAMETERS`]: those of
    /// the polynomial, of a lens that is computed by another model too.
    #[must_use]
    pub fn pixel_by_lens<F: Frame>(&self, ray: &UnitRay<F>) -> SMatrix<f64, 2, LENS_PARAMETERS> {
        self.local(ray).pixel_by_lens(self)
    }

    /// All derivatives at `ray`, at little more than the cost of one.
    pub(crate) fn derivatives<F: Frame>(&self, ray: &UnitRay<F>) -> RayDerivatives {
        let local = self.local(ray);
        let origin_by_pupil = Pupil::by_coefficients(Angle::from_rad(local.theta));
        let [e0, e1] = self.pupil().mm();
        RayDerivatives {
            origin: Vector3::z() * (e0 * origin_by_pupil[0] + e1 * origin_by_pupil[1]),
            ray_by_pixel: self.foreign_ray_by_pixel(ray).unwrap_or_else(|| local.ray_by_pixel(self)),
            pixel_by_lens: local.pixel_by_lens(self),
            origin_by_ray: local.space[0].transpose() * self.pupil().slope_mm(local.theta),
            origin_by_pupil,
        }
    }

    fn local<F: Frame>(&self, ray: &UnitRay<F>) -> Local {
        let d = ray.vector();
        let sine = d.x.hypot(d.y);
        let theta = sine.atan2(d.z);
        // On the axis every radial direction is equivalent.
        let (cos_phi, sin_phi) = if sine > 0.0 { (d.x / sine, d.y / sine) } else { (1.0, 0.0) };
        let across = if sine > 0.0 { self.series().radius(theta) / sine } else { self.k()[0] };
        let place = || Vector2::new(cos_phi, sin_phi) * (self.series().radius(theta) / self.k()[0]);
        Local {
            theta,
            space: [Vector3::new(d.z * cos_phi, d.z * sin_phi, -sine), Vector3::new(-sin_phi, cos_phi, 0.0)],
            image: [Vector2::new(cos_phi, sin_phi), Vector2::new(-sin_phi, cos_phi)],
            pixels_per_radian: [self.pixels_per_radian(Angle::from_rad(theta)), across],
            bend: (!self.is_symmetric()).then(|| self.asymmetry().by_place(place())),
        }
    }
}

impl Local {
    fn ray_by_pixel(&self, lens: &KannalaBrandt) -> Matrix3x2<f64> {
        let along = |i: usize| self.space[i] * self.image[i].transpose() / self.pixels_per_radian[i];
        let mut derivative = along(0) + along(1);
        if let Some(bend) = self.bend {
            derivative *= inverse(&bend);
        }
        derivative.column_mut(1).unscale_mut(lens.aspect());
        derivative
    }

    fn pixel_by_lens(&self, lens: &KannalaBrandt) -> SMatrix<f64, 2, LENS_PARAMETERS> {
        let [fx, fy] = [lens.k()[0], lens.k()[0] * lens.aspect()];
        let [radial, _] = self.image;
        pixel_by_lens([fx, fy], self.theta, lens.series().radius(self.theta) / fx, radial.into(), &lens.asymmetry())
    }
}

/// The inverse of a matrix; infinite or not numbers where it has none.
pub(crate) fn inverse(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    Matrix2::new(matrix.m22, -matrix.m12, -matrix.m21, matrix.m11) / matrix.determinant()
}

/// The derivative of a pixel by the lens's parameters: focal lengths in pixels, the angle from the axis, the radius in focal lengths
/// and the direction from the axis in the image of the symmetric lens, and the asymmetry.
pub(crate) fn pixel_by_lens(
    [fx, fy]: [f64; 2],
    theta: f64,
    distorted: f64,
    [cosine, sine]: [f64; 2],
    asymmetry: &Asymmetry,
) -> SMatrix<f64, 2, LENS_PARAMETERS> {
    let mut columns = SMatrix::<f64, 2, LENS_PARAMETERS>::zeros();
    let place = Vector2::new(distorted * cosine, distorted * sine);
    // Where the pixel lies, and where it moves if its radius grows.
    let (arrived, outward) = match asymmetry.is_zero() {
        true => (place, Vector2::new(cosine, sine)),
        false => (asymmetry.moved(place), asymmetry.by_place(place) * Vector2::new(cosine, sine)),
    };
    columns[(0, 0)] = arrived.x;
    columns[(1, 1)] = arrived.y;
    columns[(0, 2)] = 1.0;
    columns[(1, 3)] = 1.0;
    let (mut power, squared) = (theta, theta * theta);
    for column in (4..CENTRAL_PARAMETERS).chain(FURTHER) {
        power *= squared;
        columns[(0, column)] = fx * power * outward.x;
        columns[(1, column)] = fy * power * outward.y;
    }
    let by_asymmetry = Asymmetry::by_coefficients(place);
    for (column, by) in ASYMMETRIC.into_iter().zip(by_asymmetry.column_iter()) {
        columns[(0, column)] = fx * by.x;
        columns[(1, column)] = fy * by.y;
    }
    columns
}
