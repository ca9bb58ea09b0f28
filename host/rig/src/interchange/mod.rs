//! Cameras in the files of other programs: OpenCV's YAML and Kalibr's camchain.
//!
//! Both write `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`. Neither says how far the polynomial is valid; ours adds
//! `theta_max_deg`, which they ignore, and without it takes the largest angle that the image and the polynomial allow.

pub mod kalibr;
pub mod opencv;

use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, Left, OpenCvFisheye, Right, Transform};

/// Whose file it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraFormat {
    /// Ours.
    Toml,
    /// OpenCV's FileStorage YAML.
    OpenCv,
    /// Kalibr's camchain YAML.
    Kalibr,
}

/// A camera or a pair, and where the second is.
#[derive(Clone, Debug, PartialEq)]
pub struct Camchain {
    /// `cam0`, the left one of a pair.
    pub left: KannalaBrandt,
    /// `cam1` and its pose, where there is one.
    pub right: Option<(KannalaBrandt, Transform<Left, Right>)>,
}

/// What is wrong with another program's file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InterchangeError {
    /// Not YAML.
    #[error("not readable as YAML: {0}")]
    Syntax(String),
    /// A key is missing or of the wrong form.
    #[error("{0}")]
    Missing(String),
    /// Another camera or distortion model.
    #[error("{0}: only the fisheye (equidistant) model is read")]
    Model(String),
    /// A camera that cannot be.
    #[error("{0}")]
    Lens(InvalidLens),
}

impl CameraFormat {
    /// Tells whose file `text` is by what it begins with or contains.
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
