//! Camera files of any format that is read.

use std::path::Path;

use vergence_rig::{Camchain, CameraDocument, CameraFormat, CameraTable, Shutter, kalibr, opencv};
use vergence_vision::KannalaBrandt;

use crate::failure::Failure;

/// A camera file that has been read.
pub struct CameraFile {
    /// Whose format it is.
    pub format: CameraFormat,
    /// The camera, or a pair from a camchain.
    pub cameras: Camchain,
    /// How sure the camera is, where the file says so.
    pub document: Option<CameraDocument>,
}

impl CameraFile {
    /// How the camera exposes its rows: only our own files say.
    pub fn shutter(&self) -> Shutter {
        self.document.as_ref().map_or(Shutter::Global, |document| document.camera.shutter())
    }

    /// The same in the text of `format`. Other programs' files say less than ours.
    ///
    /// # Errors
    /// Where TOML cannot say it.
    pub fn text(&self, format: CameraFormat) -> Result<String, Failure> {
        match (format, &self.document) {
            (CameraFormat::Kalibr, _) => Ok(kalibr::write(&self.cameras)),
            (CameraFormat::OpenCv, _) => Ok(opencv::write(&self.cameras.left)),
            (CameraFormat::Toml, Some(document)) => toml_of(document),
            (CameraFormat::Toml, None) => {
                let camera = CameraTable::of(&self.cameras.left);
                toml_of(&CameraDocument { camera, calibration: None, provenance: None })
            }
        }
    }
}

/// Reads a camera file: ours, OpenCV's or Kalibr's, told apart by their contents.
///
/// # Errors
/// Says which file and what is wrong.
pub fn read(path: &Path) -> Result<CameraFile, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::input(path, error))?;
    let fail = |error: &dyn std::fmt::Display| Failure::input(path, error);
    let single = |left| Camchain { left, right: None };
    let format = CameraFormat::of(&text);
    let (cameras, document) = match format {
        CameraFormat::Kalibr => (kalibr::read(&text).map_err(|error| fail(&error))?, None),
        CameraFormat::OpenCv => (single(opencv::read(&text).map_err(|error| fail(&error))?), None),
        CameraFormat::Toml => {
            let document: CameraDocument = toml::from_str(&text).map_err(|error| fail(&error))?;
            (single(document.camera.camera().map_err(|error| fail(&error))?), Some(document))
        }
    };
    Ok(CameraFile { format, cameras, document })
}

/// A document as TOML.
///
/// # Errors
/// Where TOML cannot say it.
pub fn toml_of(document: &CameraDocument) -> Result<String, Failure> {
    toml::to_string(document).map_err(|error| Failure::check(format!("the camera cannot be written: {error}")))
}

/// The camera of a file that holds one.
///
/// # Errors
/// As [`read`].
pub fn read_camera(path: &Path) -> Result<KannalaBrandt, Failure> {
    Ok(read(path)?.cameras.left)
}
