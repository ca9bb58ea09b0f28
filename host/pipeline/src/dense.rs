//! From a pair of images and a pose to a range for every pixel.

use vergence_matching::{DenseDepth, DenseViews, MatchError};
use vergence_rig::{Rig, RigPose};

use crate::pair::PairImages;
use crate::search::Search;
use crate::stage::Stage;

/// Measures the range of every pixel of the left image. `ended` hears of the end of each stage.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn dense_ranges(
    images: PairImages<'_>,
    (rig, search): (&Rig, &Search),
    pose: &RigPose,
    ended: &mut dyn FnMut(Stage),
) -> Result<DenseDepth, MatchError> {
    images.with_grey((rig, search), pose, pose.rotation_sigma, |pair| {
        let views = DenseViews::new(pair)?;
        ended(Stage::Turn);
        let swept = views.sweep();
        ended(Stage::Sweep);
        let disparities = views.register(&swept);
        ended(Stage::Register);
        let depth = views.ranges(&disparities, &pose.shared);
        ended(Stage::Range);
        Ok(match search.farthest {
            Some(farthest) => depth.up_to(farthest),
            None => depth,
        })
    })
}
