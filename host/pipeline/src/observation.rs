//! What a live rig measures at one exposure: points by both cameras, or bearings by the one that is left.

use image::RgbImage;
use vergence_rig::{Rig, RigPose};
use vergence_vision::Side;

use crate::bearings::{Bearing, bearings};
use crate::cloud::{Method, PairCloud, PairCloudError, pair_cloud};
use crate::exposures::CameraGone;
use crate::pair::PairImages;
use crate::pose::PairPose;
use crate::pose_source::with_fused;

/// The measurement of one exposure. It holds nothing of any other.
#[derive(Clone, Debug)]
pub enum Observation {
    /// Both cameras delivered an image.
    Points {
        /// Points in the frame of the left camera at its middle row.
        cloud: Box<PairCloud>,
        /// The pose at the middle rows.
        pose: Box<RigPose>,
        /// Whether the stages moved.
        moving: bool,
    },
    /// One camera delivered an image, because the other is gone.
    Bearings {
        /// The camera that delivered.
        side: Side,
        /// Directions in its frame.
        bearings: Vec<Bearing>,
        /// Why the other camera delivers nothing.
        why: CameraGone,
    },
}

/// The points of a pair.
///
/// # Errors
/// The same errors as [`pair_cloud`].
pub fn observe_pair(
    images: PairImages<'_>,
    rig: &Rig,
    pose: &PairPose,
    method: Method<'_>,
) -> Result<Observation, PairCloudError> {
    let cloud = Box::new(pair_cloud(images, rig, pose, method, &mut |_| ())?);
    let middle = pose.at_middle();
    let used = cloud.fused_pose.as_ref().map_or_else(|| middle.clone(), |fused| with_fused(middle, fused));
    Ok(Observation::Points { cloud, pose: Box::new(used), moving: pose.is_moving() })
}

/// The bearings of the image of one camera; `why` says why the other camera delivers nothing.
#[must_use]
pub fn observe_one(image: &RgbImage, rig: &Rig, side: Side, why: CameraGone) -> Observation {
    Observation::Bearings { side, bearings: bearings(image, rig.camera(side)), why }
}
