//! Measures this program beside others (OpenCV, SciPy, ONNX Runtime, QEMU) on the same work.
//!
//! Each kind of work has a module: [`busy`] code and the [`firmware`] on the simulated chip, [`calibrate`] with chessboards,
//! right matches of simulated pairs ([`matching`]), pairs that follow one another ([`live`]), [`networks`] for a pair of images, and [`vision`] for arrays of points.
//! Functions return figures, which also say themselves in words and as JSON, and print nothing; the caller passes the clock
//! in. A peer that is missing on this machine is a sentence in the result, not an error.

pub mod busy;
pub mod calibrate;
mod error;
pub mod firmware;
mod lenses;
mod levels;
pub mod live;
pub mod matching;
pub mod networks;
pub mod peer;
mod python;
pub mod sets;
pub mod vision;
mod vision_report;

use std::time::Duration;

pub use error::BenchError;
pub use lenses::LensTimes;
pub use levels::LevelTimes;
pub use python::ask_python;

/// Returns the time since some fixed instant.
pub type Clock = fn() -> Duration;

/// The result of `work` and the seconds it took.
pub(crate) fn timed<T>(clock: Clock, work: impl FnOnce() -> T) -> (T, f64) {
    let start = clock();
    let result = work();
    (result, clock().saturating_sub(start).as_secs_f64())
}
