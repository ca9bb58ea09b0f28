//! Camera files of any format that is read.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_calibration::IntrinsicsCalibration;
use vergence_exchange::{Cameras, ExchangeError, ForeignCamera, ForeignRig, Format, Recognised};
use vergence_rig::{CalibrationTable, CameraDocument, CameraTable, Provenance, Shutter, camera_json};
use vergence_vision::{KannalaBrandt, Side};

use crate::InputError;

/// A camera file that has been read.
pub struct CameraFile {
    /// The other program's format; `None` for a file of this one.
    pub format: Option<Format>,
    /// The cameras in the order of the file, at least one.
    pub cameras: Vec<FileLens>,
    /// How sure the camera is, where the file says so.
    pub document: Option<CameraDocument>,
    /// The cameras as they stand in the other program's file.
    foreign: Option<ForeignRig>,
}

/// A camera of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileLens {
    /// Its name in the file.
    pub name: String,
    /// Its lens.
    pub lens: KannalaBrandt,
    /// How far the lens is off the camera of the file, in words; `None` where it is the same.
    pub remark: Option<String>,
}

impl FileLens {
    /// The camera for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let mut json = camera_json(&self.lens);
        json["name"] = json!(self.name);
        json["remark"] = json!(self.remark);
        json
    }
}

impl CameraFile {
    /// How the camera exposes its rows: only our own files say.
    #[must_use]
    pub fn shutter(&self) -> Shutter {
        self.document.as_ref().map_or(Shutter::Global, |document| document.camera.shutter())
    }

    /// The only camera of the file at `path`.
    ///
    /// # Errors
    /// [`InputError::Wrong`] names the cameras of a file that has several.
    pub fn only(&self, path: &Path) -> Result<&FileLens, InputError> {
        match self.cameras.as_slice() {
            [only] => Ok(only),
            several => {
                let names = several.iter().map(|camera| camera.name.clone()).collect();
                Err(InputError::wrong(path, ExchangeError::Several { names }))
            }
        }
    }

    /// The camera on `side` of a pair: the only one of the file, or the first for the left and the second for the right side of two.
    ///
    /// # Errors
    /// As [`Self::only`].
    pub fn on(&self, side: Side, path: &Path) -> Result<&FileLens, InputError> {
        match self.cameras.as_slice() {
            pair @ [_, _] => Ok(&pair[side.index()]),
            _ => self.only(path),
        }
    }

    /// The camera, or the pair, to be written in another format.
    ///
    /// # Errors
    /// [`InputError::Wrong`] where there are more than two cameras, or two without a pose.
    pub fn to_write(&self, path: &Path) -> Result<Cameras, InputError> {
        let [left, right] = self.cameras.as_slice() else {
            return Ok(Cameras { left: self.only(path)?.lens, right: None });
        };
        let pair = self.foreign.as_ref().map(|foreign| foreign.pair(None));
        let pair = pair.transpose().map_err(|error| InputError::wrong(path, error))?;
        Ok(Cameras { left: left.lens, right: pair.map(|pair| (right.lens, pair.left_from_right)) })
    }
}

/// A path, and the camera that is named after it as in `chain.yaml#cam1`. A file whose own name has that sign is taken as it is.
pub(crate) fn named_camera(path: &Path) -> (PathBuf, Option<String>) {
    let text = path.to_string_lossy();
    match text.rsplit_once('#') {
        Some((file, camera)) if !path.exists() => (PathBuf::from(file), Some(camera.to_owned())),
        _ => (path.to_owned(), None),
    }
}

/// Reads a camera file: ours or another program's, told apart by their contents. `FILE#NAME` is one camera of a file of several, by its
/// name or its number from zero.
///
/// # Errors
/// Says which file and what is wrong.
pub fn read_camera_file(path: &Path) -> Result<CameraFile, InputError> {
    let (path, camera) = named_camera(path);
    let text = vergence_files::read_text(&path)?;
    let fail = |error: &dyn std::fmt::Display| InputError::wrong(&path, error);
    if Recognised::of(&text) == Recognised::Ours {
        let document: CameraDocument = toml::from_str(&text).map_err(|error| fail(&error))?;
        let lens = document.camera.camera().map_err(|error| fail(&error))?;
        let cameras = vec![FileLens { name: "camera".to_owned(), lens, remark: None }];
        return Ok(CameraFile { format: None, cameras, document: Some(document), foreign: None });
    }
    let foreign = vergence_exchange::read(&text).map_err(|error| fail(&error))?;
    let chosen: Vec<&ForeignCamera> = match &camera {
        Some(name) => vec![foreign.camera(Some(name)).map_err(|error| fail(&error))?],
        None => foreign.cameras.iter().collect(),
    };
    let cameras = chosen.into_iter().map(file_lens).collect::<Result<Vec<_>, _>>().map_err(|error| fail(&error))?;
    Ok(CameraFile { format: Some(foreign.format), cameras, document: None, foreign: Some(foreign) })
}

/// The lens in place of a camera of another program.
pub(crate) fn file_lens(camera: &ForeignCamera) -> Result<FileLens, ExchangeError> {
    let fit = camera.lens()?;
    Ok(FileLens { name: camera.name.clone(), lens: fit.lens, remark: camera.remark(&fit) })
}

/// The text of a camera file of our own.
///
/// # Errors
/// Where TOML cannot say it.
pub fn camera_toml(document: &CameraDocument) -> Result<String, InputError> {
    toml::to_string(document).map_err(|error| InputError::Untold(error.to_string()))
}

/// The camera file of our own for a lens of which only the parameters are known.
#[must_use]
pub fn bare_document(lens: &KannalaBrandt) -> CameraDocument {
    CameraDocument { camera: CameraTable::of(lens), calibration: None, provenance: None }
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

/// The camera of a file that holds one, or of `FILE#NAME`.
///
/// # Errors
/// As [`read_camera_file`], and where the file has several cameras and none is named.
pub fn read_camera(path: &Path) -> Result<FileLens, InputError> {
    read_camera_file(path)?.only(path).cloned()
}
