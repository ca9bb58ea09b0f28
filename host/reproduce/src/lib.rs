//! Repeats the experiments of the paper "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional
//! cameras" on the simulated rig, from photographs to tables and one page.
//!
//! The precision bench is another rig for every seed ([`Bench`]). [`drive()`] moves its stage along a [`Route`] over the real
//! protocol and returns a [`Drive`]. [`one_seed`] then calibrates both lenses and the stage from photographs of a target, and
//! measures corners of targets 350 mm away by every [`Method`]; [`Table`] sums up all seeds. Each [`Cause`] of errors is also
//! tried alone, beside the figures that the paper [published](PUBLISHED). Only the renderer and the score know the truth.
//!
//! Beside it stand the zones of all modes ([`mode_zones`]), the methods of triangulation ([`study`]), and matches in the
//! simulated room ([`matchings`]). [`experiments`] does all of it and puts it on one page ([`reproduction_page`]). The same
//! seeds give the same bytes. [`demo`] measures every mode of a simulated rig in its room, scored against the truth; [`corridor`] the
//! robot's modes in a corridor.
//!
//! [`mismatch`] tries worlds that are not as the calibration assumes. [`LensedRig`] is a rig to simulate with other lenses than its file
//! states, and the file that a calibration of them gives.
//!
//! Nothing here runs another program or prints: the caller passes in what does, and the clock. Only [`demo::View::write`]
//! and [`corridor`] write files.

mod axes;
mod bench;
mod causes;
mod chain;
mod conditions;
pub mod corridor;
pub mod demo;
mod drive;
mod error;
mod experiments;
mod eyes;
mod lensed;
mod matching;
mod measure;
mod method;
pub mod mismatch;
mod one_seed;
mod own_frame;
mod page;
mod pair;
mod pinhole_pair;
mod report;
mod sgbm;
pub mod study;
mod tally;
mod target_images;
mod target_shot;
mod targets;
mod undistort;
mod undistorted;
mod zones;

pub use bench::{Bench, MODES};
pub use causes::{Closest, Column, PUBLISHED, Published};
pub use conditions::{Cause, Conditions, Repeatability, TRUE_LENS};
pub use drive::{Drive, Route, Stop, drive};
pub use error::{DemoError, ReproduceError};
pub use experiments::{DrivenRig, Plan, Progress, Results, experiments};
pub use lensed::LensedRig;
pub use matching::{Matching, MatchingTools, Outcome, Picture, matchings};
pub use measure::{Measured, Sample};
pub use method::{METHODS, Method};
pub use one_seed::{SeedResult, one_seed};
pub use own_frame::{own_frame, own_frame_by};
pub use page::{Findings, reproduction_page};
pub use sgbm::{SgbmAnswer, SgbmTask};
pub use tally::{Figures, Row, Table};
pub use target_images::target_images;
pub use target_shot::Corners;
pub use undistorted::Undistorted;
pub use zones::{ModeZones, mode_zones};
