//! What a live rig measures at one exposure: points by both cameras, or bearings by the one that is left.

use image::RgbImage;
use vergence_rig::{Rig, RigPose};
use vergence_vision::Side;

use crate::bearings::{Bearing, bearings};
use crate::cloud::{Method, PairCloud, PairCloudError, refined_cloud};
use crate::exposures::CameraGone;
use crate::memory::PoseMemory;
use crate::pair::PairImages;
use crate::pose::PairPose;
use crate::search::Search;
use crate::untold_axes::AxisByImages;

/// The measurement of one exposure. It holds nothing of any other but, while the axes stand, of their pose.
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
        /// The axes that no encoder told.
        by_images: Vec<AxisByImages>,
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

/// The points of a pair; `memory` is of the pairs before it.
///
/// # Errors
/// The same errors as [`refined_cloud`].
pub fn observe_pair(
    images: PairImages<'_>,
    rig: &Rig,
    pose: &PairPose,
    method: Method<'_>,
    memory: &mut PoseMemory,
) -> Result<Observation, PairCloudError> {
    memory.arrive(rig, pose);
    let cloud = Box::new(refined_cloud(images, rig, pose, method, &mut memory.standing, &mut |_| ())?);
    memory.keep(rig, pose, &cloud);
    let used = Box::new(cloud.pose(pose.at_middle()));
    Ok(Observation::Points { cloud, pose: used, moving: pose.is_moving(), by_images: Vec::new() })
}

/// The bearings of the image of one camera, but where the mask of `search` hides them; `why` says why the other camera delivers
/// nothing.
#[must_use]
pub fn observe_one(image: &RgbImage, (rig, search): (&Rig, &Search), side: Side, why: CameraGone) -> Observation {
    let mut bearings = bearings(image, rig.camera(side));
    bearings.retain(|bearing| !search.hides(side, bearing.pixel));
    Observation::Bearings { side, bearings, why }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use image::Rgb;
    use vergence_rig::BENCH_TOML;
    use vergence_vision::BodyMask;

    use super::*;

    #[test]
    fn no_bearing_lies_where_a_mask_hides_it() {
        let rig = Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(200).expect("a size");
        let image = RgbImage::from_fn(200, 200, |x, y| Rgb([if (x / 8 + y / 8) % 2 == 0 { 30 } else { 220 }; 3]));
        let hidden = (0..200 * 200).map(|index| index % 200 < 100).collect();
        let mask = BodyMask::new(rig.left_camera.size(), hidden).expect("as many pixels");
        let search = Search { masks: [Some(mask), None], ..Search::default() };
        let pixels = |side| match observe_one(&image, (&rig, &search), side, CameraGone::Unknown) {
            Observation::Bearings { bearings, .. } => {
                bearings.iter().map(|bearing| bearing.pixel.u).collect::<Vec<_>>()
            }
            Observation::Points { .. } => Vec::new(),
        };
        let (left, right) = (pixels(Side::Left), pixels(Side::Right));
        assert!(left.len() > 20 && left.iter().all(|u| *u >= 99.5), "{left:?}");
        assert!(right.iter().any(|u| *u < 99.5));
    }
}
