//! Why a calibration is not kept, not found, or cannot be made active.

use std::path::PathBuf;

use vergence_files::FileError;

/// Why a calibration is not kept, not found, or cannot be made active. The text is a sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The store, or a file of it, cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The user has no data folder and named none.
    #[error("there is no data folder for calibrations: name one with --store, or set VERGENCE_STORE")]
    NoDataFolder,
    /// The name cannot name a calibration.
    #[error("'{0}' is no name for a calibration: use letters, digits, - _ .")]
    Name(String),
    /// A calibration of this name is kept already.
    #[error("a calibration '{0}' is kept already and is not overwritten: choose another name")]
    Taken(String),
    /// No calibration is active.
    #[error("no calibration is active: there is nothing to go back to")]
    NothingBefore,
    /// No calibration of this name is kept.
    #[error("no calibration '{name}' is kept: {}", known(kept))]
    NotKept {
        /// The name.
        name: String,
        /// The names of the calibrations that are kept.
        kept: Vec<String>,
    },
    /// The calibration is one of a camera, where a rig is needed.
    #[error("'{name}' is a camera, not a rig: give {} to --left or --right", path.display())]
    IsCamera {
        /// Name of the calibration.
        name: String,
        /// Its file.
        path: PathBuf,
    },
    /// The file holds nothing that this program understands.
    #[error("{}: not a calibration that this program understands", .0.display())]
    Unreadable(PathBuf),
}

fn known(kept: &[String]) -> String {
    if kept.is_empty() { "none is".to_owned() } else { format!("there are {}", kept.join(", ")) }
}
