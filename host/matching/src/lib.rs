//! Homologous points in pairs of unrectified fisheye images.
//!
//! Both images are turned into one equirectangular [`View`] whose rows are epipolar curves ([`SharedFrame`]): relative
//! rotation, roll and the lens's distortion are then common to both, whatever the separation of the axes. What is
//! found there returns as pixels of the original images, so that nothing downstream sees the view.
//!
//! A [`Matcher`] takes an [`ImagePair`] and returns [`Matches`], with a reason for every keypoint it gave up.
//! [`GuidedMatcher`] is the classical one: corners, gradient histograms compared inside the epipolar band, then least
//! squares registration. [`learned::LearnedMatcher`] asks pre-trained networks of the LightGlue family instead.
//!
//! Terms: *keypoint*, a position worth comparing; *descriptor*, what its surroundings look like; *disparity*,
//! a_L − a_R, the parallax along a row; *level*, the halvings of a view's resolution.
//!
//! [`dense_depth`] gives a range to every pixel of the left image instead, with its uncertainty or the reason why there is none.
//!
//! Everything is a pure function of its arguments: the same pair gives the same matches on any number of threads.

mod consensus;
mod corners;
mod dense;
mod descriptor;
mod distinct;
mod epipolar_band;
mod guided;
pub mod learned;
mod links;
mod matcher;
mod neighbours;
mod plane;
mod propagate;
mod refine;
mod shared_field;
mod shared_frame;
mod shared_views;
mod single;
mod view;
mod wrong_pose;

pub use dense::{DenseCounts, DenseDepth, DenseRange, DenseSample, DenseViews, Disparities, Gap, Swept, dense_depth};
pub use guided::GuidedMatcher;
pub use matcher::{Drop, ImagePair, Match, MatchError, Matcher, Matches};
pub use shared_frame::{Shared, SharedFrame};
pub use single::image_corners;
pub use vergence_vision::Side;
pub use view::{Grid, View, ViewPixel};
