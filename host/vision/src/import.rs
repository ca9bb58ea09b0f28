//! Conversion of lenses from and to the parameters of OpenCV and Kalibr.

use crate::radial_series::RadialSeries;
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
        Self::from_opencv_with(camera, [0.0; 2], theta_max, size)
    }

    /// Returns this lens in OpenCV's parameters, which omit `theta_max`, the image size, and all that a lens has besides.
    #[must_use]
    pub fn to_opencv(&self) -> OpenCvFisheye {
        let [fx, rest @ ..] = self.k();
        let Pixel { u: cx, v: cy } = self.centre();
        OpenCvFisheye { fx, fy: fx * self.aspect(), cx, cy, k: rest.map(|k| k / fx) }
    }
}

impl OpenCvFisheye {
    /// The largest usable half field of a lens whose file states none.
    ///
    /// It is the angle seen at the farthest corner of the image, or 99 % of the angle where r(θ) stops growing, whichever
    /// is smaller. This is the limit of the polynomial: a lens whose image circle lies inside the sensor, or a calibration
    /// without points near the border, is usable for less.
    ///
    /// # Errors
    /// [`InvalidLens`] where the parameters describe no lens at any field.
    pub fn largest_theta(&self, size: ImageSize) -> Result<Angle, InvalidLens> {
        self.largest_theta_with([0.0; 2], size)
    }

    /// The same with the coefficients of [`KannalaBrandt::further_terms`].
    ///
    /// # Errors
    /// Those of [`Self::largest_theta`].
    pub fn largest_theta_with(&self, further: [f64; 2], size: ImageSize) -> Result<Angle, InvalidLens> {
        if self.fx <= 0.0 || self.fy <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        self.series(further).largest_theta(self.fy / self.fx, Pixel { u: self.cx, v: self.cy }, size)
    }

    pub(crate) fn series(&self, further: [f64; 2]) -> RadialSeries {
        let [k1, k2, k3, k4] = self.k;
        RadialSeries { k: [1.0, k1, k2, k3, k4].map(|k| self.fx * k), further }
    }
}

impl RadialSeries {
    /// See [`OpenCvFisheye::largest_theta`].
    pub fn largest_theta(self, aspect: f64, centre: Pixel, size: ImageSize) -> Result<Angle, InvalidLens> {
        // Near dr/dθ = 0 the uncertainty of a pixel's ray grows without bound.
        const BELOW_TURN: f64 = 0.99;
        const WIDEST: Angle = Angle::from_deg(179.0);
        let limit = self.first_turn(WIDEST.rad()).map_or(WIDEST, |turn| Angle::from_rad(BELOW_TURN * turn));
        let widest = KannalaBrandt::of_series(self, aspect, centre, limit, size)?;
        let seen =
            corners(size).map(|corner| widest.unproject::<Camera>(corner).map_or(limit, |ray| ray.angle_to_axis()));
        Ok(seen.into_iter().fold(Angle::default(), |a, b| if b > a { b } else { a }))
    }
}

/// The outer corners of the four corner pixels.
fn corners(size: ImageSize) -> [Pixel; 4] {
    let (right, bottom) = (f64::from(size.width) - 0.5, f64::from(size.height) - 0.5);
    [(-0.5, -0.5), (right, -0.5), (-0.5, bottom), (right, bottom)].map(|(u, v)| Pixel { u, v })
}
