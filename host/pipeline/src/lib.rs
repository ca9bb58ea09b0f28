//! From images and a pose to a cloud: pairing of exposures, gates, triangulation, drift of the pose, dense ranges, bearings,
//! zones.
//!
//! - [`Exposures`] finds which images of both cameras belong together, and when they were exposed;
//! - [`PairPose`] says where both cameras were while a pair was exposed: at rest, at a trigger pulse, or in motion;
//! - [`pair_cloud`] matches a [`PairImages`] and triangulates what passes the gates, whose [`limits`] all verbs share; [`cloud_of_pairs`] triangulates given
//!   correspondences;
//! - where the joints alone tell the pose too badly, joints and matches tell it together ([`PairCloud::fused_pose`], [`pose_by_images`]);
//! - while the rig stands, each pair adds to that pose ([`StandingPose`], [`refined_cloud`]), which a [`PoseMemory`] holds; what it tells of the
//!   calibration is kept for the next time that the rig stands there ([`Visits`]);
//! - a [`Search`] says between which ranges points are sought, and what masks hide;
//! - [`axes_by_images`] finds where axes stand that no encoder tells, [`observe_untold`] measures by them as long as they stand;
//! - [`dense_ranges`] measures every pixel of the left image;
//! - [`bearings`] gives the directions that one camera alone can see;
//! - a [`PointBudget`] says how many points there is time for;
//! - [`observe_pair`] and [`observe_one`] make an [`Observation`] of what a live rig delivers;
//! - [`ModeOutlook`] predicts what a mode would offer, for a choice of the mode;
//! - [`rig_zones`] and [`RigView`] say what the cameras of a rig cover, [`score`] compares ranges with the truth.
//!
//! Everything here is a pure function of its arguments: no clock, no file, no thread, no sentence for people. Callers who want
//! to know how long a [`Stage`] takes pass a callback, such as that of [`StageTimes`].

mod axes_by_images;
mod bearings;
mod cloud;
mod dense;
mod exposures;
pub mod limits;
mod memory;
mod mode_outlook;
mod observation;
mod pair;
mod pair_time;
mod point_budget;
mod pose;
mod pose_source;
mod score;
mod search;
mod stage;
mod standing;
mod untold_axes;
mod visits;
mod zones;

pub use axes_by_images::axes_by_images;
pub use bearings::{Bearing, bearings};
pub use cloud::{ColouredPoint, Dropped, Method, PairCloud, PairCloudError, cloud_of_pairs, pair_cloud, refined_cloud};
pub use dense::{DenseRanges, LiveDense, dense_ranges};
pub use exposures::{Ambiguity, CameraGone, Exposed, ExposedImage, Exposures, SkipReason, TimeBase};
pub use memory::PoseMemory;
pub use mode_outlook::ModeOutlook;
pub use observation::{Observation, observe_one, observe_pair};
pub use pair::{PairImages, colour_at};
pub use point_budget::{PairCost, PointBudget, PointLimit};
pub use pose::{Motion, PairPose, TriggeredImage, UnpairedImage, pair_exposure};
pub use pose_source::{pose_by_images, with_fused};
pub use score::{Score, Spread, score};
pub use search::{InvalidSearch, Search};
pub use stage::{Stage, StageTimes};
pub use standing::StandingPose;
pub use untold_axes::{AxisByImages, UntoldAxes, axes_told, observe_untold};
pub use visits::Visits;
pub use zones::{RigView, ZONE_RADIUS, rig_zones};
