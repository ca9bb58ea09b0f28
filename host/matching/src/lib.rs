//! Matching of pairs of unrectified fisheye images, sparse and dense.
//!
//! Both images are resampled to equirectangular [`View`]s in common axes ([`SharedFrame`]), whose rows are epipolar
//! curves. This removes the relative rotation, the roll and the lens's distortion, for any separation of the optical
//! axes. Results are given in pixels of the original images, so that callers never see the views.
//!
//! A [`Matcher`] takes an [`ImagePair`] and returns [`Matches`], with a reason for every dropped keypoint.
//! [`GuidedMatcher`] is the classical one: corners, gradient histograms compared inside the epipolar band, then
//! least-squares registration. [`learned::LearnedMatcher`] uses pre-trained networks of the LightGlue family instead, and
//! [`TrackingMatcher`] follows what it found in the pairs before, for a live rig.
//!
//! Terms: a *keypoint* is a position that is compared; a *descriptor* is a vector that describes its surroundings; the
//! *disparity* a_L − a_R is the parallax along a row; the *level* counts halvings of a view's resolution.
//!
//! [`dense_depth`] computes a range with its uncertainty, or the reason why there is none, for every pixel of the left
//! image.
//!
//! Everything is a pure function of its arguments: the same pair gives the same matches on any number of threads.

mod consensus;
mod corners;
mod dense;
mod descriptor;
mod distinct;
mod epipolar_band;
mod grid;
mod guided;
mod knots;
pub mod learned;
mod links;
mod match_errors;
mod matcher;
mod neighbours;
mod plane;
mod pool;
mod propagate;
mod refine;
mod sampling;
mod shared_field;
mod shared_frame;
mod shared_views;
mod smoothing;
mod track;
mod view;
mod view_map;
mod wrong_pose;

pub use corners::image_corners;
pub use dense::{
    DenseCounts, DenseDepth, DenseRange, DenseSample, DenseViews, Disparities, Gap, WholeDisparities, dense_depth,
};
pub use grid::{Grid, ViewPixel};
pub use guided::GuidedMatcher;
pub use matcher::{ImagePair, Match, MatchError, Matcher, Matches, UnmatchedReason};
pub use shared_frame::{Shared, SharedFrame};
pub use track::TrackingMatcher;
pub use vergence_vision::Side;
pub use view::View;
