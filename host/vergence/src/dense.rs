//! From a pair of images and a pose to a range for every pixel: what `look` is for single points.

use image::imageops::grayscale;
use vergence_matching::{DenseDepth, DenseViews, ImagePair, MatchError};
use vergence_rig::{Rig, RigPose};
use vergence_vision::Angle;

use crate::look::{Eyes, NEAREST};
use crate::stopwatch::Stopwatch;

/// The ranges, and how long each stage took.
#[derive(Clone, Debug)]
pub struct DenseLook {
    /// For every pixel of the left image.
    pub depth: DenseDepth,
    /// Stages in their order, in seconds.
    pub seconds: [(&'static str, f64); 4],
}

/// Measures the range of every pixel of the left image.
///
/// # Errors
/// Where the images do not belong to the cameras, or the cameras share no field.
pub fn dense_look(eyes: Eyes<'_>, rig: &Rig, pose: &RigPose) -> Result<DenseLook, MatchError> {
    let (left, right) = (grayscale(eyes.left), grayscale(eyes.right));
    let pair = ImagePair {
        left: &left,
        right: &right,
        left_camera: &rig.left_camera,
        right_camera: &rig.right_camera,
        left_from_right: pose.left_from_right,
        pose_sigma: Angle::from_rad(pose.rotation_sigma.rad()),
        nearest: NEAREST,
    };
    let (views, turning) = timed(|| DenseViews::new(&pair));
    let views = views?;
    let (swept, sweeping) = timed(|| views.sweep());
    let (disparities, registering) = timed(|| views.register(&swept));
    let (depth, ranging) = timed(|| views.ranges(&disparities, &pose.covariance));
    let seconds = [("turn", turning), ("sweep", sweeping), ("register", registering), ("range", ranging)];
    Ok(DenseLook { depth, seconds })
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let watch = Stopwatch::start();
    let result = work();
    (result, watch.seconds())
}
