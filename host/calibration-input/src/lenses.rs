//! The two lenses of a pair, from camera files, and how well they are known.

use std::path::Path;

use nalgebra::SMatrix;
use vergence_calibration::LensKnowledge;
use vergence_rig::{CalibrationTable, Shutter};
use vergence_vision::{KannalaBrandt, LENS_PARAMETERS, Side};

use crate::InputError;
use crate::camera_files::{CameraFile, named_camera, read_camera_file};
use crate::input_hash::InputHash;

/// What a calibration may change of the lenses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensFreedom {
    /// Nothing.
    Exact,
    /// As much as the covariance in the camera files allows.
    Known,
    /// Everything.
    Free,
}

/// The camera files of a pair.
pub struct LensFiles<'a> {
    paths: [&'a Path; 2],
    files: [CameraFile; 2],
}

/// The lenses of a pair.
pub struct KnownLenses {
    /// The left lens.
    pub left: KannalaBrandt,
    /// The right lens.
    pub right: KannalaBrandt,
    /// How they expose their rows, as far as the files say; left, right.
    pub shutters: [Shutter; 2],
    /// How well the lenses are known.
    pub knowledge: LensKnowledge,
    /// How far they are off the cameras of other programs' files, and which of a file's cameras they are, in words.
    pub remarks: Vec<String>,
}

impl<'a> LensFiles<'a> {
    /// Reads the left and the right camera file, and adds both to `hash`.
    ///
    /// # Errors
    /// [`InputError`], which names the file that cannot be used.
    pub fn read(paths: [&'a Path; 2], hash: &mut InputHash) -> Result<Self, InputError> {
        let [left, right] = paths;
        hash.add(&named_camera(left).0)?;
        hash.add(&named_camera(right).0)?;
        Ok(Self { paths, files: [read_camera_file(left)?, read_camera_file(right)?] })
    }

    /// Whether both files carry a covariance.
    #[must_use]
    pub fn carry_covariance(&self) -> bool {
        self.files.iter().all(|file| calibration_table(file).is_some())
    }

    /// The lenses with `freedom`.
    ///
    /// # Errors
    /// [`InputError::Wrong`] where [`LensFreedom::Known`] is asked for and a file carries no covariance.
    pub fn lenses(&self, freedom: LensFreedom) -> Result<KnownLenses, InputError> {
        let ([left, right], [left_path, right_path]) = (&self.files, self.paths);
        let knowledge = match freedom {
            LensFreedom::Exact => LensKnowledge::Exact,
            LensFreedom::Free => LensKnowledge::Free,
            LensFreedom::Known => LensKnowledge::within(covariance(left_path, left)?, covariance(right_path, right)?),
        };
        let shutters = self.files.each_ref().map(CameraFile::shutter);
        let (left_lens, right_lens) = (left.on(Side::Left, left_path)?, right.on(Side::Right, right_path)?);
        let remarks =
            [(left, left_lens, "left"), (right, right_lens, "right")].into_iter().flat_map(|(file, lens, side)| {
                let chosen = (file.cameras.len() > 1).then(|| format!("{} is taken as the {side} camera", lens.name));
                [chosen, lens.remark.clone()].into_iter().flatten()
            });
        let remarks = remarks.collect();
        Ok(KnownLenses { left: left_lens.lens, right: right_lens.lens, shutters, knowledge, remarks })
    }
}

fn calibration_table(file: &CameraFile) -> Option<&CalibrationTable> {
    file.document.as_ref().and_then(|document| document.calibration.as_ref())
}

fn covariance(path: &Path, file: &CameraFile) -> Result<SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>, InputError> {
    let table = calibration_table(file)
        .ok_or_else(|| InputError::wrong(path, "it has no covariance: calibrate it here, or use --lenses exact"))?;
    Ok(table.covariance)
}
