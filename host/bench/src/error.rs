//! What can go wrong with a measurement.

use std::path::{Path, PathBuf};

use vergence_models::ModelsError;
use vergence_sim::SimError;

/// Why something could not be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// A model cannot be used.
    #[error(transparent)]
    Models(#[from] ModelsError),
    /// The simulated board cannot be started, or stops.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A file cannot be read or is not understood.
    #[error("{}: {reason}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system or the parser says.
        reason: String,
    },
    /// An image cannot be read or written.
    #[error("{0}")]
    Image(String),
    /// A temporary file or folder cannot be written.
    #[error("no temporary file can be written: {0}")]
    Temporary(String),
    /// The folder of calibration data is missing.
    #[error("{}: no calibration data there; name the folder that has it with --shared or VERGENCE_SHARED", .0.display())]
    NoData(PathBuf),
    /// A peer does not run, or its answer is not understood.
    #[error("{0}; give another interpreter with --python, or measure without peers: --no-peer")]
    Peer(String),
    /// QEMU is installed and cannot be started.
    #[error("{0}")]
    QemuStart(String),
    /// QEMU does not run the program to its end.
    #[error("qemu-system-arm failed: {0}")]
    Qemu(String),
    /// The simulated chip does not run the program to its end.
    #[error("the program on the simulated chip stopped: {0}")]
    Chip(String),
    /// The threads for the measurement cannot be started.
    #[error("no thread can be started: {0}")]
    Threads(String),
    /// The work that is measured fails, so that there is nothing to measure.
    #[error("{0}")]
    Work(String),
}

impl BenchError {
    /// `path` cannot be read or understood.
    #[allow(clippy::needless_pass_by_value, reason = "callers hand over an error that they need no more")]
    pub(crate) fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }

    /// A temporary file or folder cannot be written.
    #[allow(clippy::needless_pass_by_value, reason = "callers hand over an error that they need no more")]
    pub(crate) fn temporary(reason: impl ToString) -> Self {
        Self::Temporary(reason.to_string())
    }
}
