//! The paper's experiments on the simulated rig ("Bio-inspired reconfigurable stereo vision for robotics using
//! omnidirectional cameras"): what it measured on its hardware, measured here by the whole chain.
//!
//! The precision bench, for every seed another rig ([`bench`]): the stage is [driven](drive) over the real protocol, both
//! lenses and the stage are [calibrated](chain) from photographs of a board, and corners of boards 350 mm away are
//! [measured](measure) by every method. [`tally`] makes the table. Nothing but the renderer and the score knows the truth.
//!
//! Beside it: the [zones] of all modes, the study of triangulation ([`vergence_vision::study`]), and [matches](matching) in
//! the simulated room. All of it goes on one [page].

mod axes;
mod bench;
mod board_pictures;
mod chain;
mod drive;
mod matching;
mod measure;
mod one_seed;
mod page;
mod sgbm;
mod sight;
mod tally;
mod zones;

pub use bench::Bench;
pub use board_pictures::board_pictures;
pub use drive::{Drive, drive};
pub use matching::{Matching, matchings};
pub use one_seed::{SeedResult, one_seed};
pub use page::{Findings, reproduction_page};
pub use sight::{Corners, Eyesight};
pub use tally::{Figures, Row, Table};
pub use zones::{ModeZones, mode_zones};
