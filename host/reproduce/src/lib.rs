//! Repeats the experiments of the paper "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional
//! cameras" on the simulated rig, from photographs to tables and one page.
//!
//! The precision bench is another rig for every seed ([`Bench`]). The caller drives its stage along a [`Route`] over the
//! real protocol and returns a [`Drive`]. [`one_seed`] then calibrates both lenses and the stage from photographs of a
//! target, and measures corners of targets 350 mm away by every method; [`Table`] sums up all seeds. Only the renderer and
//! the score know the truth.
//!
//! Beside it stand the zones of all modes ([`mode_zones`]), the methods of triangulation ([`vergence_vision::study`]), and matches in the simulated
//! room ([`matchings`]). [`reproduction_page`] puts all of it on one page. The same seeds give the same bytes.
//!
//! Nothing here reads a clock or a file, or runs another program: the caller passes in what does.

mod axes;
mod bench;
mod chain;
mod drive;
mod error;
mod matching;
mod measure;
mod one_seed;
mod page;
mod sgbm;
mod tally;
mod target_images;
mod target_shot;
mod zones;

pub use bench::{Bench, MODES};
pub use drive::{Drive, Route, Stop};
pub use error::ReproduceError;
pub use matching::{Matching, MatchingTools, Outcome, Picture, matchings};
pub use measure::{METHODS, Measured, Sample};
pub use one_seed::{SeedResult, one_seed};
pub use page::{Findings, reproduction_page};
pub use sgbm::{SgbmAnswer, SgbmTask};
pub use tally::{Figures, Row, Table};
pub use target_images::target_images;
pub use target_shot::{CornerSource, Corners};
pub use zones::{ModeZones, mode_zones};
