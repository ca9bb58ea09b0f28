//! Decodes the images of an exposure and measures them, and how long both take.

use image::RgbImage;
use vergence_camera::PendingImage;
use vergence_matching::Matcher;
use vergence_pipeline::{
    CameraGone, ExposedImage, Method, Observation, PairImages, PairPose, observe_one, observe_pair,
};
use vergence_rig::{BoardInstant, Rig};
use vergence_vision::Side;

use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// An exposure whose pose is known.
pub enum PosedExposure {
    /// The images of both cameras, exposed together.
    Pair(Box<[ExposedImage<PendingImage>; 2]>, Box<PairPose>),
    /// One camera, because the other is gone: its bearings need no pose.
    One {
        /// The camera that delivered.
        side: Side,
        /// Its image.
        image: Box<ExposedImage<PendingImage>>,
        /// Why the other camera delivers nothing.
        why: CameraGone,
    },
}

/// The measurement of one exposure. It holds nothing of any other.
pub struct Measurement {
    /// Points or bearings.
    pub observation: Observation,
    /// The middle of the exposure.
    pub middle: BoardInstant,
    /// How long decoding the images took: rendering, where they are simulated.
    pub decode_seconds: f64,
    /// How long matching and triangulation took.
    pub seconds: f64,
}

/// Decodes and measures `exposure`.
///
/// # Errors
/// An image that cannot be decoded or is not of its camera's size, a row whose joints are not known, cameras that share no
/// field.
pub fn measure(exposure: PosedExposure, rig: &Rig, matcher: &dyn Matcher) -> Result<Measurement, Failure> {
    let decoding = Stopwatch::start();
    match exposure {
        PosedExposure::Pair(images, pose) => {
            let [left, right] = *images;
            let middle = left.middle;
            let (left, right) = rayon::join(|| decode(left), || decode(right));
            let (left, right) = (left?, right?);
            let (decode_seconds, working) = (decoding.seconds(), Stopwatch::start());
            let images = PairImages { left: &left, right: &right };
            let observation = observe_pair(images, rig, &pose, Method::from(matcher))
                .map_err(|error| Failure::device(format!("the pair cannot be measured: {error}")))?;
            Ok(Measurement { observation, middle, decode_seconds, seconds: working.seconds() })
        }
        PosedExposure::One { side, image, why } => {
            let middle = image.middle;
            let image = decode(*image)?;
            let (decode_seconds, working) = (decoding.seconds(), Stopwatch::start());
            let observation = observe_one(&image, rig, side, why);
            Ok(Measurement { observation, middle, decode_seconds, seconds: working.seconds() })
        }
    }
}

fn decode(exposed: ExposedImage<PendingImage>) -> Result<RgbImage, Failure> {
    Ok((exposed.image.develop)()?)
}
