//! The entrance pupil of a fisheye lens, which moves along the optical axis with the angle of the ray.
//!
//! A fisheye lens has no centre: a ray at the angle θ to the axis crosses it at (0, 0, e(θ)), ahead of the paraxial entrance pupil, which is
//! the origin of the camera frame. D. Gennery, "Generalized camera calibration including fish-eye lenses", IJCV 68(3), 2006, with one
//! coefficient e0 in millimetres:
//!
//! ```text
//! e(θ) = (θ / sin θ - 1) e0
//! ```
//!
//! A point at (ρ, z) is seen at the angle that solves F = ρ cos θ - (z - e) sin θ = 0. With S the distance of the point from its pupil,
//! D = S - e' sin θ:
//!
//! ```text
//! ∂θ/∂ρ = cos θ / D      ∂θ/∂z = -sin θ / D      ∂θ/∂e0 = (θ / sin θ - 1) sin θ / D
//! ```
//!
//! One angle solves F while D > 0; a point that is nearer to the lens has none here.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::{Angle, Frame, InvalidLens, KannalaBrandt, Length, Point, UnitRay};

/// Below this angle series replace quotients of small numbers.
const PARAXIAL: f64 = 1e-3;

/// The shift θ / sin θ - 1 of the pupil at the angle `theta` in radians, in units of e0.
#[must_use]
pub fn pupil_shift(theta: f64) -> f64 {
    let squared = theta * theta;
    if theta < PARAXIAL { squared * (1.0 / 6.0 + squared * 7.0 / 360.0) } else { theta / theta.sin() - 1.0 }
}

/// The derivative of [`pupil_shift`] by the angle.
#[must_use]
pub fn pupil_shift_slope(theta: f64) -> f64 {
    let (sine, cosine) = theta.sin_cos();
    if theta < PARAXIAL {
        theta * (1.0 / 3.0 + theta * theta * 7.0 / 90.0)
    } else {
        (sine - theta * cosine) / (sine * sine)
    }
}

/// The angle to the axis at which a lens with `e0_mm` sees a point `rho` beside the axis and `z` ahead of the origin, in millimetres, and
/// D of the module's head in millimetres.
///
/// `None` for a point at the origin, and for one nearer to its pupil than e' sin θ.
#[must_use]
pub fn angle_of_point(e0_mm: f64, rho: f64, z: f64) -> Option<(f64, f64)> {
    /// From 50 mm three steps suffice.
    const STEPS: usize = 20;
    let mut theta = rho.atan2(z);
    for _ in 0..STEPS {
        let (sine, cosine) = theta.sin_cos();
        let ahead = z - e0_mm * pupil_shift(theta);
        // -dF/dθ: D where F is zero.
        let slope = rho * sine + ahead * cosine - e0_mm * pupil_shift_slope(theta) * sine;
        if slope.is_nan() || slope <= 0.0 {
            return None;
        }
        let step = (rho * cosine - ahead * sine) / slope;
        theta = (theta + step).clamp(0.0, 3.1);
        if step.abs() <= 4.0 * f64::EPSILON {
            break;
        }
    }
    let (sine, ahead) = (theta.sin(), z - e0_mm * pupil_shift(theta));
    let slope = rho.hypot(ahead) - e0_mm * pupil_shift_slope(theta) * sine;
    (slope > 0.0).then_some((theta, slope))
}

impl KannalaBrandt {
    /// This lens with a pupil that moves by `e0` times θ / sin θ - 1. Normal fisheye lenses have an e0 of about twice their focal length in
    /// millimetres; zero is a central lens.
    ///
    /// # Errors
    /// [`InvalidLens::NotFinite`].
    pub fn with_pupil(self, e0: Length) -> Result<Self, InvalidLens> {
        if e0.mm().is_finite() { Ok(self.moved_pupil(e0.mm())) } else { Err(InvalidLens::NotFinite) }
    }

    /// The coefficient e0 of the pupil's shift; zero of a central lens.
    #[must_use]
    pub const fn pupil(&self) -> Length {
        Length::from_mm(self.pupil_mm())
    }

    /// Whether all rays go through one point.
    #[must_use]
    pub fn is_central(&self) -> bool {
        self.pupil_mm() == 0.0
    }

    /// Where `ray` crosses the optical axis: the point from which it starts.
    #[must_use]
    pub fn origin_of<F: Frame>(&self, ray: &UnitRay<F>) -> Point<F> {
        if self.is_central() {
            return Point::from_mm(Vector3::zeros());
        }
        Point::from_mm(Vector3::new(0.0, 0.0, self.pupil_mm() * pupil_shift(ray.angle_to_axis().rad())))
    }

    /// The direction of the ray by which the lens sees `point`, from [`Self::origin_of`] that ray.
    ///
    /// `None` at the optical centre, and for a point so near that it has no single ray.
    #[must_use]
    pub fn ray_to<F: Frame>(&self, point: &Point<F>) -> Option<UnitRay<F>> {
        if self.is_central() {
            return point.direction();
        }
        let at = point.mm();
        let rho = at.x.hypot(at.y);
        let (theta, _) = angle_of_point(self.pupil_mm(), rho, at.z)?;
        let (sine, cosine) = theta.sin_cos();
        // On the axis the sine is zero too.
        let across = if rho > 0.0 { sine / rho } else { 0.0 };
        UnitRay::new(Vector3::new(at.x * across, at.y * across, cosine))
    }

    /// The central lens that images points at `distance` from the origin as this one does, for programs that know of no other. The five
    /// coefficients are fitted by least squares over the field.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens fits, as for points nearer than the pupil moves.
    pub fn central_at(&self, distance: Length) -> Result<Self, InvalidLens> {
        if self.is_central() {
            return Ok(*self);
        }
        let seen = self.radii_at(distance);
        let outermost = seen.last().map_or(0.0, |(central, _)| *central);
        let (mut normal, mut right) = (SMatrix::<f64, 5, 5>::zeros(), SVector::<f64, 5>::zeros());
        for (central, radius) in &seen {
            let row = SVector::<f64, 5>::from_fn(|i, _| (central / outermost).powi(2 * i as i32 + 1));
            normal += row * row.transpose();
            right += row * *radius;
        }
        let fitted = normal.cholesky().ok_or(InvalidLens::NotFinite)?.solve(&right);
        let k = std::array::from_fn(|i| fitted[i] / outermost.powi(2 * i as i32 + 1));
        Self::new(k, self.aspect(), self.centre(), Angle::from_rad(outermost), self.size())
    }

    /// The largest distance in pixels between the images of points at `distance` by this lens and by `central`.
    #[must_use]
    pub fn largest_difference(&self, central: &Self, distance: Length) -> f64 {
        let off = |(angle, radius): &(f64, f64)| (central.radius_at(*angle) - radius).abs();
        self.radii_at(distance).iter().map(off).fold(0.0, f64::max)
    }

    /// Angles of points at `distance` as seen from the origin, over the field, and the radii of their images in pixels.
    fn radii_at(&self, distance: Length) -> Vec<(f64, f64)> {
        const SAMPLES: usize = 200;
        let seen = |sample: usize| {
            let central = self.theta_max().rad() * sample as f64 / SAMPLES as f64;
            let (sine, cosine) = central.sin_cos();
            let (theta, _) = angle_of_point(self.pupil_mm(), distance.mm() * sine, distance.mm() * cosine)?;
            (theta <= self.theta_max().rad()).then(|| (central, self.radius_at(theta)))
        };
        (1..=SAMPLES).filter_map(seen).collect()
    }
}
