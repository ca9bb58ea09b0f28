//! From a pair of images and a pose to a range for every pixel.

use image::RgbImage;
use vergence_alignment::{PoseDrift, pose_drift};
use vergence_matching::{DenseDepth, DenseViews, MatchError};
use vergence_rig::{Rig, RigPose};
use vergence_vision::StereoPair;

use crate::limits::expected_drift;
use crate::pair::PairImages;
use crate::search::Search;
use crate::stage::Stage;

/// The dense result of one pair.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseRanges {
    /// A range, or the reason for none, for every pixel of the left image.
    pub depth: DenseDepth,
    /// The correction of the pose that the images ask for, where they show enough. The search follows it, ranges do not.
    pub pose_drift: Option<PoseDrift>,
}

impl DenseRanges {
    /// The drift, where the images disagree with the pose by more than its stated uncertainty.
    #[must_use]
    pub fn significant_drift(&self) -> Option<&PoseDrift> {
        self.pose_drift.as_ref().filter(|drift| drift.is_significant())
    }
}

/// The ranges of a pair that came live, beside its points.
#[derive(Clone, Debug)]
pub struct LiveDense {
    /// A range for every pixel; `None` where the pose changed while the rows were exposed: ranges are by one pose.
    pub ranges: Option<DenseRanges>,
    /// The left image, which has the colours of the points.
    pub left: RgbImage,
    /// How long measuring took.
    pub seconds: f64,
}

/// Measures the range of every pixel of the left image. `ended` hears of the end of each stage.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn dense_ranges(
    images: PairImages<'_>,
    (rig, search): (&Rig, &Search),
    pose: &RigPose,
    ended: &mut dyn FnMut(Stage),
) -> Result<DenseRanges, MatchError> {
    images.with_grey((rig, search), pose, pose.rotation_sigma, |pair| {
        let views = DenseViews::new(pair)?;
        ended(Stage::Turn);
        let mut views = views.aligned();
        let stated =
            StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
        ended(Stage::Align);
        let matches = views.row_matches().to_vec();
        // What the images say of the pose is for people: the search does not wait for it.
        let drift = || pose_drift(&matches, &stated, &expected_drift(pose));
        let (swept, pose_drift) = rayon::join(|| views.sweep(), drift);
        ended(Stage::Sweep);
        let disparities = views.register(swept);
        ended(Stage::Register);
        let depth = views.ranges(&disparities, &pose.shared);
        ended(Stage::Range);
        let depth = match search.farthest {
            Some(farthest) => depth.up_to(farthest),
            None => depth,
        };
        Ok(DenseRanges { depth, pose_drift })
    })
}
