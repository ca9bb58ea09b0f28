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

use std::future::poll_fn;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;

use vergence_files::{FileError, WholeFolder};
use vergence_recording::RecordingError;
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
/// rig file needs none. The folder gets its name when all is written: an `interruption`, or a failure, leaves nothing.
///
/// # Errors
/// What cannot be read or written; options that the format has not; [`ExportError::Interrupted`].
pub async fn export(
    inputs: Vec<PathBuf>,
    rig: Option<Rig>,
    options: Options,
    interruption: impl Future<Output = ()>,
) -> Result<Exported, ExportError> {
    let mut interruption = pin!(interruption);
    // It is heard from before anything is written.
    if poll_fn(|context| Poll::Ready(interruption.as_mut().poll(context).is_ready())).await {
        return Err(ExportError::Interrupted(options.out));
    }
    let asked = Arc::new(AtomicBool::new(false));
    let stop = Stop(Arc::clone(&asked));
    let mut work = tokio::task::spawn_blocking(move || whole(&inputs, rig, &options, &stop));
    let done = tokio::select! {
        done = &mut work => done,
        () = &mut interruption => {
            asked.store(true, Ordering::Relaxed);
            // It ends after the image that it is at, and removes what it has written.
            work.await
        }
    };
    done.unwrap_or_else(|error| Err(ExportError::GivenUp(error.to_string())))
}

/// Whether the export shall end before all is written.
struct Stop(Arc<AtomicBool>);

impl Stop {
    fn check(&self, options: &Options) -> Result<(), ExportError> {
        if self.0.load(Ordering::Relaxed) { Err(ExportError::Interrupted(options.out.clone())) } else { Ok(()) }
    }
}

/// Exports under a temporary name, which the folder keeps until all is written.
fn whole(inputs: &[PathBuf], rig: Option<Rig>, options: &Options, stop: &Stop) -> Result<Exported, ExportError> {
    let has_views = !options.faces.is_empty() || options.field.is_some() || options.size.is_some();
    match options.to {
        ExportFormat::TumVi if has_views => return Err(ExportError::NoViews),
        ExportFormat::Euroc if options.faces.iter().any(|face| *face != Face::Front) => {
            return Err(ExportError::FrontOnly);
        }
        _ => {}
    }
    let folder = WholeFolder::begin(&options.out)?;
    let beside = &Options { out: folder.path().to_owned(), ..options.clone() };
    let exported = match (inputs, options.to) {
        ([recording], _) => recorded::export(recording, rig, beside, stop),
        ([left, right], ExportFormat::Pinhole) => images::export([left.as_path(), right.as_path()], rig, beside, stop),
        _ => Err(ExportError::Timeless),
    };
    let exported = exported.map_err(|error| named(error, &options.out))?;
    folder.finish()?;
    Ok(Exported { out: options.out.clone(), ..exported })
}

/// The error with the name that the user gave, where it tells of what is removed.
fn named(error: ExportError, out: &Path) -> ExportError {
    match error {
        ExportError::Interrupted(_) => ExportError::Interrupted(out.to_owned()),
        ExportError::Recording(RecordingError::DiskFull(_)) => {
            FileError::write(out, "the disk is full; nothing of it is kept").into()
        }
        error => error,
    }
}
