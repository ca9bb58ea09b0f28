//! Cameras as TOML: the table that rig files and camera files share.

use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye, Time};

use crate::exposure::Shutter;
use crate::text::{angle_text, optional_quantity, time_text};

/// The keys of a camera table, with coefficients as in OpenCV fisheye and Kalibr equidistant files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Half the field of view. If absent, [`OpenCvFisheye::largest_theta`].
    #[serde(
        default,
        deserialize_with = "optional_quantity",
        serialize_with = "angle_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub theta_max: Option<Angle>,
    /// Time from the exposure of one row to that of the next, of a rolling shutter; negative where the image is read
    /// from the bottom. If absent, all rows are exposed at once.
    #[serde(
        default,
        deserialize_with = "optional_quantity",
        serialize_with = "time_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub line_time: Option<Time>,
    /// Horizontal focal length in pixels.
    pub fx: f64,
    /// Vertical focal length in pixels.
    pub fy: f64,
    /// Column of the principal point in pixels.
    pub cx: f64,
    /// Row of the principal point in pixels.
    pub cy: f64,
    /// Coefficient of θ³ relative to that of θ.
    pub opencv_k1: f64,
    /// Coefficient of θ⁵ relative to that of θ.
    pub opencv_k2: f64,
    /// Coefficient of θ⁷ relative to that of θ.
    pub opencv_k3: f64,
    /// Coefficient of θ⁹ relative to that of θ.
    pub opencv_k4: f64,
}

impl CameraTable {
    /// Makes the table of a camera with a global shutter.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        let OpenCvFisheye { fx, fy, cx, cy, k: [opencv_k1, opencv_k2, opencv_k3, opencv_k4] } = camera.to_opencv();
        let ImageSize { width, height } = camera.size();
        let theta_max = Some(camera.measured_field());
        let (size, line_time) = ([width, height], None);
        Self { size, theta_max, line_time, fx, fy, cx, cy, opencv_k1, opencv_k2, opencv_k3, opencv_k4 }
    }

    /// Replaces the shutter.
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        let line_time = match shutter {
            Shutter::Global => None,
            Shutter::Rolling { line_us } => Some(Time::from_us(line_us)),
        };
        Self { line_time, ..self }
    }

    /// The shutter of the camera.
    #[must_use]
    pub fn shutter(&self) -> Shutter {
        self.line_time.map_or(Shutter::Global, |time| Shutter::Rolling { line_us: time.us() })
    }

    /// Makes the lens that the table describes.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens has these parameters.
    pub fn camera(&self) -> Result<KannalaBrandt, InvalidLens> {
        let [width, height] = self.size;
        let size = ImageSize { width, height };
        let k = [self.opencv_k1, self.opencv_k2, self.opencv_k3, self.opencv_k4];
        let lens = OpenCvFisheye { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, k };
        let theta_max = match self.theta_max {
            Some(stated) => stated,
            None => lens.largest_theta(size)?,
        };
        KannalaBrandt::from_opencv(lens, theta_max, size)
    }
}

/// A camera file: the camera, its calibration's figures, and its provenance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraDocument {
    /// The camera.
    pub camera: CameraTable,
    /// The calibration's figures; absent in files written by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationTable>,
    /// The provenance; absent in files written by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// The figures of a camera's calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationTable {
    /// RMS of the corner residuals (distance in the image) in pixels, over the corners that the fit kept.
    pub rms_inlier_px: f64,
    /// Number of corners that the fit kept.
    pub corners: usize,
    /// Number of views of the target.
    pub views: usize,
    /// Covariance of fx, fy, cx, cy in pixels and opencv_k1 to opencv_k4, row by row.
    pub covariance: [[f64; 8]; 8],
}

/// Provenance of a calibration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The program and its version.
    pub program: String,
    /// SHA-256 over all inputs, in hexadecimal.
    pub inputs_sha256: String,
    /// The date that the caller stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
}
