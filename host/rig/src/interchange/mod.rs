//! Camera files of other programs: OpenCV's YAML and Kalibr's camchain.
//!
//! Both use `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, and neither states up to which angle the polynomial is
//! valid. Files written here add the key `theta_max_deg`, which both programs ignore. Without it the largest angle is
//! taken that the image and the polynomial allow ([`OpenCvFisheye::largest_theta`]).

pub mod kalibr;
pub mod opencv;

use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, Left, OpenCvFisheye, Right, Transform};

/// The format of a camera file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraFormat {
    /// The TOML of this program.
    Toml,
    /// The FileStorage YAML of OpenCV.
    OpenCv,
    /// The camchain YAML of Kalibr.
    Kalibr,
}

/// A camera, or a pair with its relative pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Camchain {
    /// The lens of `cam0`, which is the left camera of a pair.
    pub left: KannalaBrandt,
    /// The lens of `cam1` and its pose, for a pair.
    pub right: Option<(KannalaBrandt, Transform<Left, Right>)>,
}

/// The reason why a camera file of another program is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InterchangeError {
    /// Not YAML.
    #[error("not readable as YAML: {0}")]
    Syntax(String),
    /// A key is missing or has the wrong form.
    #[error("{0}")]
    Missing(String),
    /// The file is of another camera or distortion model.
    #[error("{0}: only the fisheye (equidistant) model is read")]
    Model(String),
    /// The parameters describe no lens.
    #[error("{0}")]
    Lens(InvalidLens),
}

impl CameraFormat {
    /// Recognises the format of the file content `text`.
    #[must_use]
    pub fn of(text: &str) -> Self {
        if text.lines().any(|line| line.trim_end() == "cam0:") {
            Self::Kalibr
        } else if text.starts_with("%YAML") || text.contains("!!opencv-matrix") {
            Self::OpenCv
        } else {
            Self::Toml
        }
    }
}

fn parse<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, InterchangeError> {
    // OpenCV's "%YAML:1.0" is not the directive that the standard means.
    let body: String = text.lines().filter(|line| !line.starts_with('%')).flat_map(|line| [line, "\n"]).collect();
    serde_saphyr::from_str(&body).map_err(|error| InterchangeError::Syntax(error.to_string()))
}

fn camera(lens: OpenCvFisheye, size: ImageSize, theta_max_deg: Option<f64>) -> Result<KannalaBrandt, InterchangeError> {
    let theta_max = match theta_max_deg {
        Some(deg) => Ok(Angle::from_deg(deg)),
        None => lens.largest_theta(size),
    };
    theta_max.and_then(|theta| KannalaBrandt::from_opencv(lens, theta, size)).map_err(InterchangeError::Lens)
}
