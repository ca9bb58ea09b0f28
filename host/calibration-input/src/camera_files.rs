//! Camera files of any format that is read.

use std::path::Path;

use vergence_calibration::IntrinsicsCalibration;
use vergence_rig::{
    CalibrationTable, Camchain, CameraDocument, CameraFormat, CameraTable, Provenance, Shutter, kalibr, opencv,
};
use vergence_vision::KannalaBrandt;

use crate::InputError;

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
    #[must_use]
    pub fn shutter(&self) -> Shutter {
        self.document.as_ref().map_or(Shutter::Global, |document| document.camera.shutter())
    }

    /// The same in the text of `format`. Other programs' files say less than ours.
    ///
    /// # Errors
    /// Where TOML cannot say it.
    pub fn text(&self, format: CameraFormat) -> Result<String, InputError> {
        match (format, &self.document) {
            (CameraFormat::Kalibr, _) => Ok(kalibr::write(&self.cameras)),
            (CameraFormat::OpenCv, _) => Ok(opencv::write(&self.cameras.left)),
            (CameraFormat::Toml, Some(document)) => camera_toml(document),
            (CameraFormat::Toml, None) => {
                let camera = CameraTable::of(&self.cameras.left);
                camera_toml(&CameraDocument { camera, calibration: None, provenance: None })
            }
        }
    }
}

/// Reads a camera file: ours, OpenCV's or Kalibr's, told apart by their contents.
///
/// # Errors
/// Says which file and what is wrong.
pub fn read_camera_file(path: &Path) -> Result<CameraFile, InputError> {
    let text = vergence_files::read_text(path)?;
    let fail = |error: &dyn std::fmt::Display| InputError::wrong(path, error);
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

/// The text of a camera file of our own.
///
/// # Errors
/// Where TOML cannot say it.
pub fn camera_toml(document: &CameraDocument) -> Result<String, InputError> {
    toml::to_string(document).map_err(|error| InputError::Untold(error.to_string()))
}

/// The camera file of our own for a calibrated camera.
#[must_use]
pub fn document_of(calibration: &IntrinsicsCalibration, provenance: Provenance) -> CameraDocument {
    let covariance = &calibration.covariance;
    CameraDocument {
        camera: CameraTable::of(&calibration.camera),
        calibration: Some(CalibrationTable {
            rms_inlier_px: calibration.rms_inlier_px,
            corners: calibration.corners_inlier,
            views: calibration.views_used,
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| covariance[(row, column)])),
        }),
        provenance: Some(provenance),
    }
}

/// The camera of a file that holds one.
///
/// # Errors
/// As [`read_camera_file`].
pub fn read_camera(path: &Path) -> Result<KannalaBrandt, InputError> {
    Ok(read_camera_file(path)?.cameras.left)
}
