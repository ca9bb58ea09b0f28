//! A camera as TOML: the table that rig files and calibrations share.

use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye, Time};

use crate::moving::Shutter;
use crate::text::{angle_text, optional_quantity, time_text};

/// The keys of a camera table. Coefficients as in OpenCV fisheye and Kalibr equidistant files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Half the field. Absent: as far as the polynomial is valid and the image reaches.
    #[serde(
        default,
        deserialize_with = "optional_quantity",
        serialize_with = "angle_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub theta_max: Option<Angle>,
    /// Of a rolling shutter: from the exposure of one row to the next one's; negative where the image is read from the
    /// bottom. Absent: all rows are exposed at once.
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
    /// Principal point.
    pub cx: f64,
    /// Principal point.
    pub cy: f64,
    /// Of θ³, as a ratio to θ.
    pub opencv_k1: f64,
    /// Of θ⁵.
    pub opencv_k2: f64,
    /// Of θ⁷.
    pub opencv_k3: f64,
    /// Of θ⁹.
    pub opencv_k4: f64,
}

impl CameraTable {
    /// The table of a camera with a global shutter.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        let OpenCvFisheye { fx, fy, cx, cy, k: [opencv_k1, opencv_k2, opencv_k3, opencv_k4] } = camera.to_opencv();
        let ImageSize { width, height } = camera.size();
        let theta_max = Some(camera.theta_max());
        let (size, line_time) = ([width, height], None);
        Self { size, theta_max, line_time, fx, fy, cx, cy, opencv_k1, opencv_k2, opencv_k3, opencv_k4 }
    }

    /// The same with another shutter.
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        let line_time = match shutter {
            Shutter::Global => None,
            Shutter::Rolling { line_us } => Some(Time::from_us(line_us)),
        };
        Self { line_time, ..self }
    }

    /// How the camera exposes its rows.
    #[must_use]
    pub fn shutter(&self) -> Shutter {
        self.line_time.map_or(Shutter::Global, |time| Shutter::Rolling { line_us: time.us() })
    }

    /// The camera of the table.
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

/// A calibrated camera: the table, how sure it is, and where it comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraDocument {
    /// The camera.
    pub camera: CameraTable,
    /// How sure it is; absent in files written by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationTable>,
    /// Where it comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// How sure a camera is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationTable {
    /// Point RMS of the corners that the fit kept, in pixels.
    pub rms_inlier_px: f64,
    /// How many it kept.
    pub corners: usize,
    /// From how many views.
    pub views: usize,
    /// Covariance of fx, fy, cx, cy, opencv_k1 to opencv_k4, row by row.
    pub covariance: [[f64; 8]; 8],
}

/// Where a calibration comes from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The program and its version.
    pub program: String,
    /// SHA-256 over all inputs, in hexadecimal.
    pub inputs_sha256: String,
    /// When, as the caller said it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
}
