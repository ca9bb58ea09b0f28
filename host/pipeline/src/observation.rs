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
    memory.forget_untold();
    let cloud = Box::new(refined_cloud(images, rig, pose, method, &mut memory.standing, &mut |_| ())?);
    let used = Box::new(cloud.pose(pose.at_middle()));
    Ok(Observation::Points { cloud, pose: used, moving: pose.is_moving(), by_images: Vec::new() })
}

/// The bearings of the image of one camera, but where the mask of `search` hides them; `why` says why the other camera delivers
/// nothing.
#[must_use]
pub fn observe_one(image: &RgbImage, (rig, search): (&Rig, &Search), side: Side, why: CameraGone) -> Observation {
    let errors = rig.lens_covariance(side).unwrap_or_default();
    let mut bearings = bearings(image, rig.camera(side), &errors);
    bearings.retain(|bearing| !search.hides(side, bearing.pixel));
    Observation::Bearings { side, bearings, why }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use image::Rgb;
    use nalgebra::DMatrix;
    use vergence_rig::{BENCH_TOML, CalibratedNumbers, LensField, RigCalibration, RigNumber};
    use vergence_vision::{Angle, BodyMask};

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

    /// The corners of the image lie beyond the field in which the lens was measured: they are no bearings, or marked and less sure.
    #[test]
    fn bearings_of_an_extrapolated_lens_are_marked_and_less_sure() {
        let rig = Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(200).expect("a size");
        let numbers = [Side::Left, Side::Right].map(|side| RigNumber::Lens { side, parameter: 7 }).to_vec();
        let covariance = DMatrix::from_diagonal_element(2, 2, 1e-6);
        let known = CalibratedNumbers::new(numbers, covariance).expect("a covariance");
        let rig = Rig { calibration: RigCalibration::Covariance(known), ..rig };
        let image = RgbImage::from_fn(200, 200, |x, y| Rgb([if (x / 8 + y / 8) % 2 == 0 { 30 } else { 220 }; 3]));
        let seen = |field| {
            let rig = rig.clone().measuring_in(field).expect("the lenses' errors are known");
            match observe_one(&image, (&rig, &Search::default()), Side::Left, CameraGone::Unknown) {
                Observation::Bearings { bearings, .. } => bearings,
                Observation::Points { .. } => Vec::new(),
            }
        };
        let (measured, all) = (seen(LensField::Measured), seen(LensField::Extrapolated));
        assert!(measured.len() > 100 && measured.iter().all(|bearing| !bearing.extrapolated));
        let beyond: Vec<_> = all.iter().filter(|bearing| bearing.extrapolated).collect();
        assert!(beyond.len() > 20, "{}", beyond.len());
        let largest =
            measured.iter().map(|bearing| bearing.sigma).fold(Angle::default(), |a, b| if b > a { b } else { a });
        assert!(beyond.iter().filter(|bearing| bearing.sigma > largest).count() * 2 > beyond.len());
        let unknown = Rig { calibration: RigCalibration::exact(), ..rig.clone() };
        assert!(unknown.measuring_in(LensField::Extrapolated).is_err());
    }
}
