//! Camera files of any format that is read.

use std::path::Path;

use vergence_calibration::IntrinsicsCalibration;
use vergence_rig::{
    CalibrationTable, Camchain, CameraDocument, CameraFormat, CameraTable, Provenance, Shutter, kalibr, opencv,
};
use vergence_vision::{KannalaBrandt, Length};

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

    /// The same in the text of `format`. Other programs' files say less than ours: a lens whose pupil moves becomes the central one that
    /// images points 500 mm away alike, with a comment that says how much they differ elsewhere.
    ///
    /// # Errors
    /// Where TOML cannot say it, and where no central lens comes near.
    pub fn text(&self, format: CameraFormat) -> Result<String, InputError> {
        match (format, &self.document) {
            (CameraFormat::Kalibr, _) => {
                let (left, mut remarks) = central(&self.cameras.left)?;
                let right = match &self.cameras.right {
                    Some((right, left_from_right)) => {
                        let (right, remark) = central(right)?;
                        remarks += &remark;
                        Some((right, *left_from_right))
                    }
                    None => None,
                };
                Ok(kalibr::write(&Camchain { left, right }) + &remarks)
            }
            (CameraFormat::OpenCv, _) => {
                let (left, remark) = central(&self.cameras.left)?;
                Ok(opencv::write(&left) + &remark)
            }
            (CameraFormat::Toml, Some(document)) => camera_toml(document),
            (CameraFormat::Toml, None) => {
                let camera = CameraTable::of(&self.cameras.left);
                camera_toml(&CameraDocument { camera, calibration: None, provenance: None })
            }
        }
    }
}

/// A central and symmetric lens in place of `camera`, and a comment for the file where it is another.
fn central(camera: &KannalaBrandt) -> Result<(KannalaBrandt, String), InputError> {
    if camera.fits_opencv() {
        return Ok((*camera, String::new()));
    }
    let central = camera.central_at(Length::from_mm(500.0)).map_err(|error| InputError::Untold(error.to_string()))?;
    let off = |mm: f64| camera.largest_difference(&central, Length::from_mm(mm));
    let remark = format!(
        "# The pupil of this lens moves (e0 = {:.3} mm), or it is not symmetric about its axis, which this format cannot say. The lens \
         above images points 500 mm away as it does to {:.3} px; points 200 mm away are up to {:.2} px off, points 2 m away {:.2} px.\n",
        camera.pupil().e0.mm(),
        off(500.0),
        off(200.0),
        off(2000.0)
    );
    Ok((central, remark))
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
            covariance: *covariance,
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
