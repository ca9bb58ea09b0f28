//! The entrance pupil of a fisheye lens, which moves along the optical axis with the angle of the ray.
//!
//! A fisheye lens has no centre: a ray at the angle θ to the axis crosses it at (0, 0, e(θ)), ahead of the paraxial entrance pupil, which is
//! the origin of the camera frame. D. Gennery, "Generalized camera calibration including fish-eye lenses", IJCV 68(3), 2006, with two
//! coefficients in millimetres:
//!
//! ```text
//! e(θ) = (θ / sin θ - 1) (e0 + e1 θ²)
//! ```
//!
//! A point at (ρ, z) is seen at the angle that solves F = ρ cos θ - (z - e) sin θ = 0. With S the distance of the point from its pupil,
//! D = S - e' sin θ, and E0 = θ / sin θ - 1, E1 = E0 θ²:
//!
//! ```text
//! ∂θ/∂ρ = cos θ / D      ∂θ/∂z = -sin θ / D      ∂θ/∂ej = Ej sin θ / D
//! ```
//!
//! One angle solves F while D > 0; a point that is nearer to the lens has none here.

use nalgebra::Vector3;

use crate::{Angle, Frame, InvalidLens, KannalaBrandt, Length, Point, UnitRay};

/// Below this angle series replace quotients of small numbers.
const PARAXIAL: f64 = 1e-3;

/// The shift θ / sin θ - 1 of the pupil at the angle `theta` in radians, in units of e0.
#[must_use]
pub fn pupil_shift(theta: f64) -> f64 {
    pupil_shift_by_sine(theta, theta.sin())
}

/// [`pupil_shift`] where the `sine` of the angle is known.
#[must_use]
pub fn pupil_shift_by_sine(theta: f64, sine: f64) -> f64 {
    let squared = theta * theta;
    if theta < PARAXIAL { squared * (1.0 / 6.0 + squared * 7.0 / 360.0) } else { theta / sine - 1.0 }
}

/// The derivative of [`pupil_shift`] by the angle.
#[must_use]
pub fn pupil_shift_slope(theta: f64) -> f64 {
    let (sine, cosine) = theta.sin_cos();
    shifts(theta, sine, cosine)[1]
}

/// [`pupil_shift`] and its first and second derivative.
fn shifts(theta: f64, sine: f64, cosine: f64) -> [f64; 3] {
    let (squared, over) = (theta * theta, 1.0 / sine);
    if theta < PARAXIAL {
        let slope = theta * (1.0 / 3.0 + squared * 7.0 / 90.0);
        return [squared * (1.0 / 6.0 + squared * 7.0 / 360.0), slope, 1.0 / 3.0 + squared * 7.0 / 30.0];
    }
    let (ratio, slope) = (theta * over, (sine - theta * cosine) * (over * over));
    [ratio - 1.0, slope, ratio - 2.0 * cosine * slope * over]
}

/// How the pupil of a lens moves along the axis with the angle of the ray. The default stays at the origin: a central lens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pupil {
    /// The shift per θ / sin θ - 1 on the axis. Normal fisheye lenses have about twice their focal length in millimetres.
    pub e0: Length,
    /// Its growth with the square of the angle in radians.
    pub e1: Length,
}

impl From<Length> for Pupil {
    /// With the coefficient e0 alone.
    fn from(e0: Length) -> Self {
        Self { e0, e1: Length::default() }
    }
}

impl Pupil {
    /// The pupil with these coefficients e0 and e1 in millimetres.
    #[must_use]
    pub const fn from_mm([e0, e1]: [f64; 2]) -> Self {
        Self { e0: Length::from_mm(e0), e1: Length::from_mm(e1) }
    }

    /// The coefficients e0 and e1 in millimetres.
    #[must_use]
    pub const fn mm(&self) -> [f64; 2] {
        [self.e0.mm(), self.e1.mm()]
    }

    /// Whether all rays go through the origin.
    #[must_use]
    pub fn is_fixed(&self) -> bool {
        self.mm().iter().all(|coefficient| *coefficient == 0.0)
    }

    /// The place of the pupil ahead of the origin, for a ray at the angle `theta` to the axis.
    #[must_use]
    pub fn shift(&self, theta: Angle) -> Length {
        Length::from_mm(self.shift_mm(theta.rad()))
    }

    /// e(θ) in millimetres.
    pub(crate) fn shift_mm(&self, theta: f64) -> f64 {
        let [e0, e1] = self.mm();
        (e0 + e1 * (theta * theta)) * pupil_shift(theta)
    }

    /// de/dθ in millimetres.
    pub(crate) fn slope_mm(&self, theta: f64) -> f64 {
        let [e0, e1] = self.mm();
        (e0 + e1 * (theta * theta)) * pupil_shift_slope(theta) + 2.0 * e1 * theta * pupil_shift(theta)
    }

    /// The derivative of e(θ) by e0 and by e1.
    #[must_use]
    pub fn by_coefficients(theta: Angle) -> [f64; 2] {
        let (theta, shift) = (theta.rad(), pupil_shift(theta.rad()));
        [shift, shift * theta * theta]
    }

    /// How a lens with this pupil sees a point `rho` beside the axis and `z` ahead of the origin, in millimetres.
    ///
    /// `None` for a point at the origin, and for one nearer to its pupil than e' sin θ.
    #[must_use]
    pub fn seen(&self, rho: f64, z: f64) -> Option<SeenPoint> {
        const STEPS: usize = 20;
        /// What a shorter step leaves, about its cube, is far below the rounding error of the angle.
        const SHORT: f64 = 1e-5;
        let range = (rho * rho + z * z).sqrt();
        let mut seen = SeenPoint { theta: rho.atan2(z), sine: rho / range, cosine: z / range, slope: 0.0 };
        for _ in 0..STEPS {
            let [off, bend] = self.off(&mut seen, rho, z)?;
            let newton = off / seen.slope;
            // The root of the parabola, to second order; farther away it need not be nearer.
            let longer = (0.5 * bend * newton / seen.slope).clamp(-0.5, 0.5);
            seen.turn_to((seen.theta + newton * (1.0 + longer)).clamp(0.0, 3.1));
            if newton.abs() <= SHORT {
                seen.slope -= bend * newton;
                return (seen.slope > 0.0).then_some(seen);
            }
        }
        self.off(&mut seen, rho, z).map(|_| seen)
    }

    /// F of the module's head and its second derivative, and its slope -dF/dθ in `seen`, which is D where F is zero; `None` where there is no way
    /// to zero.
    fn off(&self, seen: &mut SeenPoint, rho: f64, z: f64) -> Option<[f64; 2]> {
        let ([e0, e1], SeenPoint { theta, sine, cosine, .. }) = (self.mm(), *seen);
        let [shift, slope, bend] = shifts(theta, sine, cosine);
        let (growth, more) = (e0 + e1 * theta * theta, 2.0 * e1);
        let bend = growth * bend + more * (2.0 * theta * slope + shift);
        let (ahead, slope) = (z - growth * shift, growth * slope + more * theta * shift);
        seen.slope = rho * sine + ahead * cosine - slope * sine;
        let off = rho * cosine - ahead * sine;
        (seen.slope > 0.0).then_some([off, 2.0 * slope * cosine + bend * sine - off])
    }
}

/// How a lens sees a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPoint {
    /// The angle to the axis in radians, its sine and its cosine.
    pub theta: f64,
    /// See [`Self::theta`].
    pub sine: f64,
    /// See [`Self::theta`].
    pub cosine: f64,
    /// D of the module's head in millimetres.
    pub slope: f64,
}

impl SeenPoint {
    fn turn_to(&mut self, theta: f64) {
        /// By less, the first terms of the series are exact: by so much a point at 60 mm is off by a pupil that moves by 3 mm.
        const SMALL: f64 = 0.05;
        let by = theta - self.theta;
        self.theta = theta;
        if by.abs() > SMALL {
            (self.sine, self.cosine) = theta.sin_cos();
            return;
        }
        let square = by * by;
        let sin = by * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)));
        let versine = square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0)));
        (self.sine, self.cosine) = (
            self.sine + (self.cosine * sin - self.sine * versine),
            self.cosine - (self.sine * sin + self.cosine * versine),
        );
    }
}

impl KannalaBrandt {
    /// This lens with a pupil that moves so; a [`Length`] is its coefficient e0.
    ///
    /// # Errors
    /// [`InvalidLens::NotFinite`].
    pub fn with_pupil(self, pupil: impl Into<Pupil>) -> Result<Self, InvalidLens> {
        let pupil = pupil.into();
        let is_finite = pupil.mm().iter().all(|coefficient| coefficient.is_finite());
        if is_finite { Ok(self.moved_pupil(pupil)) } else { Err(InvalidLens::NotFinite) }
    }

    /// Whether all rays go through one point.
    #[must_use]
    pub fn is_central(&self) -> bool {
        self.pupil().is_fixed()
    }

    /// Where `ray` crosses the optical axis: the point from which it starts.
    #[must_use]
    pub fn origin_of<F: Frame>(&self, ray: &UnitRay<F>) -> Point<F> {
        if self.is_central() {
            return Point::from_mm(Vector3::zeros());
        }
        Point::from_mm(Vector3::new(0.0, 0.0, self.pupil().shift_mm(ray.angle_to_axis().rad())))
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
        let SeenPoint { sine, cosine, .. } = self.pupil().seen(rho, at.z)?;
        // On the axis the sine is zero too.
        let across = if rho > 0.0 { sine / rho } else { 0.0 };
        UnitRay::new(Vector3::new(at.x * across, at.y * across, cosine))
    }
}
