//! How the image radius of a lens grows with the angle to its axis.
//!
//! Most lenses have five coefficients. A lens may have two more, of θ¹¹ and θ¹³: with k5 and k6 in the form of OpenCV,
//!
//! ```text
//! r(θ) = f θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸ + k5 θ¹⁰ + k6 θ¹²)
//! ```

use crate::{Angle, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye, Pixel};

/// Number of coefficients with the further terms.
pub(crate) const TERMS: usize = 7;

/// The polynomial r(θ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RadialSeries {
    /// Coefficients of θ to θ⁹ in pixels.
    pub k: [f64; 5],
    /// Coefficients of θ¹¹ and θ¹³ over that of θ; zero where a lens has none.
    pub further: [f64; 2],
}

impl RadialSeries {
    pub fn has_further(&self) -> bool {
        self.further.iter().any(|term| *term != 0.0)
    }

    /// All coefficients in pixels.
    pub fn terms(&self) -> [f64; TERMS] {
        let ([k1, k2, k3, k4, k5], [k6, k7]) = (self.k, self.further.map(|term| self.k[0] * term));
        [k1, k2, k3, k4, k5, k6, k7]
    }

    /// The image radius r(θ) in pixels.
    pub fn radius(&self, theta: f64) -> f64 {
        let (k, s) = (&self.k, theta * theta);
        if self.has_further() {
            return theta * self.terms().iter().rev().fold(0.0, |sum, term| sum * s + term);
        }
        theta * (k[0] + s * (k[1] + s * (k[2] + s * (k[3] + s * k[4]))))
    }

    /// The slope dr/dθ in pixels per radian.
    pub fn slope(&self, theta: f64) -> f64 {
        let (k, s) = (&self.k, theta * theta);
        if self.has_further() {
            let terms = self.terms().into_iter().zip([1.0, 3.0, 5.0, 7.0, 9.0, 11.0, 13.0]);
            return terms.rev().fold(0.0, |sum, (term, power)| sum * s + power * term);
        }
        k[0] + s * (3.0 * k[1] + s * (5.0 * k[2] + s * (7.0 * k[3] + s * 9.0 * k[4])))
    }

    /// The first θ up to `limit` where dr/dθ ≤ 0, found by a scan in thousandths of `limit` and bisection.
    pub fn first_turn(&self, limit: f64) -> Option<f64> {
        const STEPS: u32 = 1000;
        let at = |i: u32| limit * f64::from(i) / f64::from(STEPS);
        let beyond = (0..=STEPS).find(|&i| self.slope(at(i)) <= 0.0)?;
        let (mut growing, mut turned) = (at(beyond.saturating_sub(1)), at(beyond));
        while turned - growing > 4.0 * f64::EPSILON {
            let middle = 0.5 * (growing + turned);
            if self.slope(middle) > 0.0 { growing = middle } else { turned = middle }
        }
        Some(turned)
    }
}

impl KannalaBrandt {
    /// Makes a lens from OpenCV's parameters and `further`, the coefficients k5 and k6 of θ¹⁰ and θ¹² in the same form, without unit.
    ///
    /// # Errors
    /// The errors of [`KannalaBrandt::new`].
    pub fn from_opencv_with(
        camera: OpenCvFisheye,
        further: [f64; 2],
        theta_max: Angle,
        size: ImageSize,
    ) -> Result<Self, InvalidLens> {
        // Checked here, because the quotient fy / fx hides two negative signs.
        if camera.fx <= 0.0 || camera.fy <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        let centre = Pixel { u: camera.cx, v: camera.cy };
        Self::of_series(camera.series(further), camera.fy / camera.fx, centre, theta_max, size)
    }

    /// The coefficients k5 and k6 of θ¹⁰ and θ¹² in OpenCV's form; zeros where the lens has none.
    #[must_use]
    pub const fn further_terms(&self) -> [f64; 2] {
        self.series().further
    }

    /// Whether the radius has terms beyond θ⁹.
    #[must_use]
    pub fn has_further_terms(&self) -> bool {
        self.series().has_further()
    }
}
