//! Calibration that needs no luck: boards, intrinsics, extrinsics, the moving stage, and how sure each of them is.
//!
//! Everything is a pure function of its arguments; images and corners come in, calibrations with covariance go out.

mod board;

pub use board::{BoardSpec, BoardView, Corner};
