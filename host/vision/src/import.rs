//! Conversion of lenses from and to the parameters of OpenCV and Kalibr.

use crate::kannala_brandt::first_turn;
use crate::{Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, Pixel};

/// Lens parameters of OpenCV's `cv::fisheye` and of Kalibr's `equidistant` distortion, which share one form:
///
/// ```text
/// θd = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)        u = cx + fx θd cos φ        v = cy + fy θd sin φ
/// ```
///
/// The model has no skew; a file with a skew other than zero describes another model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenCvFisheye {
    /// Horizontal focal length in pixels.
    pub fx: f64,
    /// Vertical focal length in pixels.
    pub fy: f64,
    /// Column of the principal point in pixels.
    pub cx: f64,
    /// Row of the principal point in pixels.
    pub cy: f64,
    /// Distortion coefficients k1 to k4, without unit.
    pub k: [f64; 4],
}

impl KannalaBrandt {
    /// Makes a lens from OpenCV's parameters.
    ///
    /// OpenCV's files state no field of view: where `theta_max` is unknown, use [`OpenCvFisheye::largest_theta`].
    ///
    /// # Errors
    /// The errors of [`KannalaBrandt::new`].
    pub fn from_opencv(camera: OpenCvFisheye, theta_max: Angle, size: ImageSize) -> Result<Self, InvalidLens> {
        // Checked here, because the quotient fy / fx hides two negative signs.
        if camera.fx <= 0.0 || camera.fy <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        Self::new(camera.coefficients(), camera.fy / camera.fx, camera.principal_point(), theta_max, size)
    }

    /// Returns this lens in OpenCV's parameters, which omit `theta_max` and the image size.
    #[must_use]
    pub fn to_opencv(&self) -> OpenCvFisheye {
        let [fx, rest @ ..] = self.k();
        let Pixel { u: cx, v: cy } = self.centre();
        OpenCvFisheye { fx, fy: fx * self.aspect(), cx, cy, k: rest.map(|k| k / fx) }
    }
}

impl OpenCvFisheye {
    /// The largest usable half field of these parameters, see [`largest_theta()`].
    ///
    /// # Errors
    /// The errors of [`largest_theta()`].
    pub fn largest_theta(&self, size: ImageSize) -> Result<Angle, InvalidLens> {
        if self.fx <= 0.0 || self.fy <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        largest_theta(self.coefficients(), self.fy / self.fx, self.principal_point(), size)
    }

    fn coefficients(&self) -> [f64; 5] {
        let [k1, k2, k3, k4] = self.k;
        [1.0, k1, k2, k3, k4].map(|k| self.fx * k)
    }

    const fn principal_point(&self) -> Pixel {
        Pixel { u: self.cx, v: self.cy }
    }
}

/// The largest usable half field of a lens whose file states none.
///
/// It is the angle seen at the farthest corner of the image, or 99 % of the angle where r(θ) stops growing, whichever
/// is smaller. This is the limit of the polynomial: a lens whose image circle lies inside the sensor, or a calibration
/// without points near the border, is usable for less. The arguments are those of [`KannalaBrandt::new`].
///
/// # Errors
/// [`InvalidLens`] where the parameters describe no lens at any field.
pub fn largest_theta(k: [f64; 5], aspect: f64, centre: Pixel, size: ImageSize) -> Result<Angle, InvalidLens> {
    // Near dr/dθ = 0 the uncertainty of a pixel's ray grows without bound.
    const BELOW_TURN: f64 = 0.99;
    const WIDEST: Angle = Angle::from_deg(179.0);
    let limit = first_turn(&k, WIDEST.rad()).map_or(WIDEST, |turn| Angle::from_rad(BELOW_TURN * turn));
    let widest = KannalaBrandt::new(k, aspect, centre, limit, size)?;
    let seen = corners(size).map(|corner| widest.unproject::<Camera>(corner).map_or(limit, |ray| ray.angle_to_axis()));
    Ok(seen.into_iter().fold(Angle::default(), |a, b| if b > a { b } else { a }))
}

/// The outer corners of the four corner pixels.
fn corners(size: ImageSize) -> [Pixel; 4] {
    let (right, bottom) = (f64::from(size.width) - 0.5, f64::from(size.height) - 0.5);
    [(-0.5, -0.5), (right, -0.5), (-0.5, bottom), (right, bottom)].map(|(u, v)| Pixel { u, v })
}
