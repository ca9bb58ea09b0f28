//! Decodes the images of an exposure and measures them, and how long both take.

use std::time::Duration;

use image::RgbImage;
use vergence_camera::PendingImage;
use vergence_pipeline::{
    CameraGone, ExposedImage, Method, Observation, PairImages, PairPose, observe_one, observe_pair,
};
use vergence_rig::{BoardInstant, Rig};
use vergence_vision::Side;

use crate::{Clock, LiveError};

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

impl Measurement {
    /// A measurement by its times: when decoding began, when matching began, and the end.
    fn new(observation: Observation, middle: BoardInstant, [begun, decoded, done]: [Duration; 3]) -> Self {
        let seconds = |from: Duration, to: Duration| to.saturating_sub(from).as_secs_f64();
        Self { observation, middle, decode_seconds: seconds(begun, decoded), seconds: seconds(decoded, done) }
    }
}

/// Decodes and measures `exposure`; `clock` says how long both take.
///
/// # Errors
/// An image that cannot be decoded or is not of its camera's size, a row whose joints are not known, cameras that share no
/// field.
pub fn measure(exposure: PosedExposure, rig: &Rig, method: Method<'_>, clock: Clock) -> Result<Measurement, LiveError> {
    let begun = clock();
    match exposure {
        PosedExposure::Pair(images, pose) => {
            let [left, right] = *images;
            let middle = left.middle;
            let (left, right) = rayon::join(|| decode(left), || decode(right));
            let (left, right) = (left?, right?);
            let decoded = clock();
            let images = PairImages { left: &left, right: &right };
            let observation =
                observe_pair(images, rig, &pose, method).map_err(|error| LiveError::Unmeasurable(error.to_string()))?;
            Ok(Measurement::new(observation, middle, [begun, decoded, clock()]))
        }
        PosedExposure::One { side, image, why } => {
            let middle = image.middle;
            let image = decode(*image)?;
            let decoded = clock();
            let observation = observe_one(&image, (rig, method.search), side, why);
            Ok(Measurement::new(observation, middle, [begun, decoded, clock()]))
        }
    }
}

fn decode(exposed: ExposedImage<PendingImage>) -> Result<RgbImage, LiveError> {
    Ok((exposed.image.develop)()?)
}
