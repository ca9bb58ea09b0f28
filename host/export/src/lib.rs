//! Recordings and images for other programs: folders as those of EuRoC and TUM-VI, and virtual pinhole views.
//!
//! [`export`] reads a recording, or two images, and writes what [`Options`] say. [`Exported`] says what became of it.

mod error;
mod exported;
mod images;
mod pinhole;
mod recorded;
mod sequence;
mod stage;
mod views;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use vergence_files::make_folder;
use vergence_rig::Rig;
use vergence_vision::{Angle, Face};

pub use error::ExportError;
pub use exported::Exported;

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// A folder as those of the TUM-VI data set: the images as they are, with the fisheye lens `equidistant`.
    TumVi,
    /// A folder as those of the EuRoC data set: a pinhole view of each camera, because EuRoC knows no fisheye lens.
    Euroc,
    /// Pinhole views: of a recording a ROS 2 bag, of images PNG files.
    Pinhole,
}

/// A word that names no format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not written: tum-vi, euroc or pinhole")]
pub struct UnknownExport(String);

impl FromStr for ExportFormat {
    type Err = UnknownExport;

    fn from_str(text: &str) -> Result<Self, UnknownExport> {
        match text {
            "tum-vi" => Ok(Self::TumVi),
            "euroc" => Ok(Self::Euroc),
            "pinhole" => Ok(Self::Pinhole),
            _ => Err(UnknownExport(text.to_owned())),
        }
    }
}

/// What is exported, and where to.
#[derive(Clone, Debug)]
pub struct Options {
    /// What is written.
    pub to: ExportFormat,
    /// The views of each camera; empty for all of the format.
    pub faces: Vec<Face>,
    /// The field across a view; `None` for 90°.
    pub field: Option<Angle>,
    /// Pixels across a view; `None` for as many as show the middle as large as the camera does.
    pub size: Option<u32>,
    /// The folder that is written.
    pub out: PathBuf,
}

/// Exports `inputs`: a recording, or an image of the left and one of the right camera, or a folder of each. `rig` has their lenses; a recording that has a
/// rig file needs none.
///
/// # Errors
/// What cannot be read or written; options that the format has not.
pub fn export(inputs: &[PathBuf], rig: Option<Rig>, options: &Options) -> Result<Exported, ExportError> {
    let has_views = !options.faces.is_empty() || options.field.is_some() || options.size.is_some();
    match options.to {
        ExportFormat::TumVi if has_views => return Err(ExportError::NoViews),
        ExportFormat::Euroc if options.faces.iter().any(|face| *face != Face::Front) => {
            return Err(ExportError::FrontOnly);
        }
        _ => {}
    }
    match (inputs, options.to) {
        ([recording], _) => recorded::export(recording, rig, options),
        ([left, right], ExportFormat::Pinhole) => images::export([left.as_path(), right.as_path()], rig, options),
        _ => Err(ExportError::Timeless),
    }
}

/// Makes the folder at `path`, unless it holds something.
fn make_empty(path: &Path) -> Result<(), ExportError> {
    make_folder(path)?;
    let mut entries = std::fs::read_dir(path).map_err(|error| vergence_files::FileError::read(path, error))?;
    if entries.next().is_some() { Err(ExportError::NotEmpty(path.to_owned())) } else { Ok(()) }
}
