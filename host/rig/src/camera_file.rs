//! A camera as TOML: the table that rig files and calibrations share.

use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye};

use crate::text::{angle_text, optional_quantity};

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
    /// The table of a camera.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        let OpenCvFisheye { fx, fy, cx, cy, k: [opencv_k1, opencv_k2, opencv_k3, opencv_k4] } = camera.to_opencv();
        let ImageSize { width, height } = camera.size();
        let theta_max = Some(camera.theta_max());
        Self { size: [width, height], theta_max, fx, fy, cx, cy, opencv_k1, opencv_k2, opencv_k3, opencv_k4 }
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
