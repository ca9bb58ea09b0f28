//! Lenses that are not symmetric about their axis, because elements were mounted off it or tilted, or the sensor is not square to it.
//!
//! With m the place of a ray in the image of the symmetric lens, in focal lengths from the principal point, its light arrives at
//!
//! ```text
//! m' = m + 2 (m·P) m + |m|² P + (s0 |m|² + s1 |m|⁴, s2 |m|² + s3 |m|⁴),  P = (p1, p2) + |m|² (p3, p4)
//! ```
//!
//! P is decentring (D. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32(3), 1966, where it grows with the radius
//! along p; OpenCV has p1 and p2 in the other order), s is thin prism distortion (J. Weng, P. Cohen and M. Herniou, "Camera calibration with
//! distortion models and accuracy evaluation", PAMI 14(10), 1992, with the fourth power). The direction on the axis stays where it is.

use nalgebra::{Matrix2, SMatrix, Vector2};

use crate::lens_derivatives::inverse;
use crate::{InvalidLens, KannalaBrandt, Pixel};

/// Number of coefficients of an [`Asymmetry`].
pub(crate) const ASYMMETRY: usize = 8;

/// By how much a lens is not symmetric about its axis. The default is symmetric.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asymmetry {
    /// Decentring p1 and p2, per focal length.
    pub tangential: [f64; 2],
    /// Thin prism: s0 and s1 along u, s2 and s3 along v; s0 and s2 per focal length, s1 and s3 per focal length cubed.
    pub prism: [f64; 4],
    /// How decentring grows with the square of the radius: p3 and p4, per focal length cubed.
    pub growth: [f64; 2],
}

impl Asymmetry {
    /// The coefficients in the order p1, p2, s0, s1, s2, s3, p3, p4.
    #[must_use]
    pub const fn to_array(&self) -> [f64; ASYMMETRY] {
        let ([p1, p2], [s0, s1, s2, s3], [p3, p4]) = (self.tangential, self.prism, self.growth);
        [p1, p2, s0, s1, s2, s3, p3, p4]
    }

    /// The asymmetry of [`Self::to_array`].
    #[must_use]
    pub const fn from_array([p1, p2, s0, s1, s2, s3, p3, p4]: [f64; ASYMMETRY]) -> Self {
        Self { tangential: [p1, p2], prism: [s0, s1, s2, s3], growth: [p3, p4] }
    }

    /// Whether all coefficients are zero.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.to_array().iter().all(|coefficient| *coefficient == 0.0)
    }

    /// m' of the module's head.
    #[must_use]
    pub fn moved(&self, m: Vector2<f64>) -> Vector2<f64> {
        let square = m.norm_squared();
        let (p, [s0, s1, s2, s3]) = (Vector2::from(self.tangential) + Vector2::from(self.growth) * square, self.prism);
        let prism = Vector2::new(s0 + s1 * square, s2 + s3 * square) * square;
        m + m * (2.0 * m.dot(&p)) + p * square + prism
    }

    /// The derivative of m' by m.
    #[must_use]
    pub fn by_place(&self, m: Vector2<f64>) -> Matrix2<f64> {
        let (square, growth, [s0, s1, s2, s3]) = (m.norm_squared(), Vector2::from(self.growth), self.prism);
        let p = Vector2::from(self.tangential) + growth * square;
        let by_square =
            Vector2::new(s0 + 2.0 * s1 * square, s2 + 2.0 * s3 * square) + m * (2.0 * m.dot(&growth)) + growth * square;
        let across = m * p.transpose() + (p + by_square) * m.transpose();
        Matrix2::identity() * (1.0 + 2.0 * m.dot(&p)) + across * 2.0
    }

    /// The derivative of m' by the coefficients, in the order of [`Self::to_array`].
    #[must_use]
    pub fn by_coefficients(m: Vector2<f64>) -> SMatrix<f64, 2, ASYMMETRY> {
        let ([u, v], square) = ([Vector2::x(), Vector2::y()], m.norm_squared());
        let (p1, p2, fourth) = (m * (2.0 * m.x) + u * square, m * (2.0 * m.y) + v * square, square * square);
        SMatrix::from_columns(&[p1, p2, u * square, u * fourth, v * square, v * fourth, p1 * square, p2 * square])
    }

    /// m by m', with Newton's method. `None` where the image folds, which is outside the field of every lens that
    /// [`KannalaBrandt::with_asymmetry`] accepts.
    #[must_use]
    pub fn place_of(&self, moved: Vector2<f64>) -> Option<Vector2<f64>> {
        const STEPS: usize = 30;
        /// What a shorter step leaves, about its square, is below rounding.
        const SHORT: f64 = 1e-9;
        let mut m = moved;
        for _ in 0..STEPS {
            let by_place = self.by_place(m);
            if by_place.determinant().is_nan() || by_place.determinant() <= 0.0 {
                return None;
            }
            let step = inverse(&by_place) * (moved - self.moved(m));
            m += step;
            if step.norm_squared() <= SHORT * SHORT {
                return Some(m);
            }
        }
        None
    }

    /// Whether two places within `radius` focal lengths of the centre share an image, or nearly so.
    fn folds_within(&self, radius: f64) -> bool {
        const RINGS: usize = 24;
        const AROUND: usize = 72;
        /// Least area of an image over that by the symmetric lens.
        const LEAST: f64 = 0.05;
        (0..RINGS * AROUND).any(|place| {
            let ring = radius * (place / AROUND + 1) as f64 / RINGS as f64;
            let (sine, cosine) = (std::f64::consts::TAU * (place % AROUND) as f64 / AROUND as f64).sin_cos();
            let grown = self.by_place(Vector2::new(ring * cosine, ring * sine)).determinant();
            grown.is_nan() || grown < LEAST
        })
    }
}

impl KannalaBrandt {
    /// This lens with elements or a sensor off its axis; the default is a symmetric lens.
    ///
    /// # Errors
    /// [`InvalidLens::NotFinite`], and [`InvalidLens::Folds`] where two rays of the field would share a pixel.
    pub fn with_asymmetry(self, asymmetry: Asymmetry) -> Result<Self, InvalidLens> {
        if !asymmetry.to_array().iter().all(|coefficient| coefficient.is_finite()) {
            return Err(InvalidLens::NotFinite);
        }
        if !asymmetry.is_zero() && asymmetry.folds_within(self.radius_max() / self.k()[0]) {
            return Err(InvalidLens::Folds);
        }
        Ok(self.made_asymmetric(asymmetry))
    }

    /// Whether the image is symmetric about the principal point, but for the aspect ratio.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.asymmetry().is_zero()
    }

    /// Whether [`crate::OpenCvFisheye`] holds all that this lens does: it is central and symmetric, has no further radial
    /// terms, and is computed by no other model.
    #[must_use]
    pub fn fits_opencv(&self) -> bool {
        self.is_central() && self.is_symmetric() && !self.has_further_terms() && self.foreign_model().is_none()
    }

    /// Where light arrives that the symmetric lens would image at `pixel`.
    pub(crate) fn with_displacement(&self, pixel: Pixel) -> Pixel {
        if self.is_symmetric() {
            return pixel;
        }
        self.pixel_at(self.asymmetry().moved(self.place_of(pixel)))
    }

    /// Where the symmetric lens would image the light that arrives at `pixel`; `None` outside the field.
    pub(crate) fn without_displacement(&self, pixel: Pixel) -> Option<Pixel> {
        if self.is_symmetric() {
            return Some(pixel);
        }
        Some(self.pixel_at(self.asymmetry().place_of(self.place_of(pixel))?))
    }

    /// A pixel in focal lengths from the principal point.
    fn place_of(&self, pixel: Pixel) -> Vector2<f64> {
        let ([f, ..], centre) = (self.k(), self.centre());
        Vector2::new((pixel.u - centre.u) / f, (pixel.v - centre.v) / (f * self.aspect()))
    }

    fn pixel_at(&self, place: Vector2<f64>) -> Pixel {
        let ([f, ..], centre) = (self.k(), self.centre());
        Pixel { u: centre.u + f * place.x, v: centre.v + f * self.aspect() * place.y }
    }
}
