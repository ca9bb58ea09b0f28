//! Decodes the images of an exposure and measures them, and how long both take.

use std::panic::resume_unwind;
use std::thread;
use std::time::Duration;

use image::RgbImage;
use vergence_camera::PendingImage;
use vergence_pipeline::{
    CameraGone, ExposedImage, LiveDense, Method, Observation, PairImages, PairPose, PoseMemory, UntoldAxes,
    dense_ranges, observe_one, observe_pair, observe_untold,
};
use vergence_rig::{BoardInstant, Rig};
use vergence_vision::Side;

use crate::{Clock, LiveError};

/// An exposure whose pose is known.
pub enum PosedExposure {
    /// The images of both cameras, exposed together.
    Pair(Box<[ExposedImage<PendingImage>; 2]>, Box<PairPose>),
    /// The images of both cameras of a rig that stood so long ago when its board last told where, because the link ended.
    Unseen(Box<[ExposedImage<PendingImage>; 2]>, Box<PairPose>, Duration),
    /// The images of both cameras of a rig that stands, some of whose axes are told by no encoder.
    /// With the time since the last readings, where the link ended.
    Untold(Box<[ExposedImage<PendingImage>; 2]>, UntoldAxes, Option<Duration>),
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

/// The measurement of one exposure. It holds nothing of any other but, while the axes stand, of their pose.
pub struct Measurement {
    /// Points or bearings.
    pub observation: Observation,
    /// The middle of the exposure.
    pub middle: BoardInstant,
    /// How long before it the last encoder readings came, where the link to the board ended.
    pub unseen: Option<Duration>,
    /// How long decoding the images took: rendering, where they are simulated.
    pub decode_seconds: f64,
    /// How long matching and triangulation took, and measuring every pixel.
    pub seconds: f64,
    /// A range for every pixel, where that is wanted and both cameras delivered.
    pub dense: Option<LiveDense>,
}

impl Measurement {
    /// A measurement by its times: when decoding began, when matching began, and the end.
    fn new(observation: Observation, middle: BoardInstant, [begun, decoded, done]: [Duration; 3]) -> Self {
        let seconds = |from: Duration, to: Duration| to.saturating_sub(from).as_secs_f64();
        Self {
            observation,
            middle,
            unseen: None,
            decode_seconds: seconds(begun, decoded),
            seconds: seconds(decoded, done),
            dense: None,
        }
    }
}

/// Decodes and measures `exposure`, every pixel too where it `is_dense`; `memory` is of the exposures before it, `clock` says how long both take. `None` where neither
/// encoders nor images tell where the axes are.
///
/// # Errors
/// An image that cannot be decoded or is not of its camera's size, a row whose joints are not known, cameras that share no
/// field.
pub fn measure(
    exposure: PosedExposure,
    rig: &Rig,
    (method, is_dense): (Method<'_>, bool),
    memory: &mut PoseMemory,
    clock: Clock,
) -> Result<Option<Measurement>, LiveError> {
    let begun = clock();
    let mut unseen = None;
    let (images, pose) = match exposure {
        PosedExposure::One { side, image, why } => {
            let middle = image.middle;
            let image = decode(*image)?;
            let decoded = clock();
            let observation = observe_one(&image, (rig, method.search), side, why);
            return Ok(Some(Measurement::new(observation, middle, [begun, decoded, clock()])));
        }
        PosedExposure::Pair(images, pose) => (images, Ok(pose)),
        PosedExposure::Unseen(images, pose, since) => {
            unseen = Some(since);
            (images, Ok(pose))
        }
        PosedExposure::Untold(images, untold, since) => {
            unseen = since;
            (images, Err(untold))
        }
    };
    let (middle, [left, right]) = both(*images)?;
    let (images, decoded) = (PairImages { left: &left, right: &right }, clock());
    // Images tell the pose of a rig that stands.
    let is_steady = pose.as_ref().map_or(true, |pose| pose.is_steady() && !pose.is_moving());
    let observed = match pose {
        Ok(pose) => observe_pair(images, rig, &pose, method, memory).map(Some),
        Err(untold) => observe_untold(images, rig, &untold, method, memory),
    };
    let observed = observed.map_err(|error| LiveError::Unmeasurable(error.to_string()))?;
    let Some(observation) = observed else { return Ok(None) };
    let begun_dense = clock();
    let ranges = match &observation {
        Observation::Points { pose, .. } if is_dense && is_steady => {
            let ranges = dense_ranges(images, (rig, method.search), pose, &mut |_| ());
            Some(ranges.map_err(|error| LiveError::Unmeasurable(error.to_string()))?)
        }
        _ => None,
    };
    let done = clock();
    let seconds = done.saturating_sub(begun_dense).as_secs_f64();
    let dense = is_dense.then_some(LiveDense { ranges, left, seconds });
    Ok(Some(Measurement { unseen, dense, ..Measurement::new(observation, middle, [begun, decoded, done]) }))
}

/// Both images, and the middle of the exposure of the left one.
fn both([left, right]: [ExposedImage<PendingImage>; 2]) -> Result<(BoardInstant, [RgbImage; 2]), LiveError> {
    let middle = left.middle;
    // On threads outside of rayon's pool: a recorder may be developing the same image, and a worker of the pool that waits for it may have begun
    // a part of that very work.
    let (left, right) = thread::scope(|scope| {
        let right = scope.spawn(|| decode(right));
        (decode(left), right.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    Ok((middle, [left?, right?]))
}

fn decode(exposed: ExposedImage<PendingImage>) -> Result<RgbImage, LiveError> {
    Ok((exposed.image.develop)()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Regression: a recorded run stood still for ever, because a worker of rayon's pool waited for an image that the recorder was developing, and
    /// the recorder for a part of its rendering that lay on the stack of that worker.
    #[test]
    fn images_are_developed_outside_of_rayons_pool() {
        let pending = || {
            let develop = Box::new(|| {
                assert_eq!(rayon::current_thread_index(), None, "a worker of the pool develops");
                Ok(RgbImage::new(1, 1))
            });
            let middle = BoardInstant { us: 0.0, error_us: 0.0 };
            let seen = vergence_rig::HostInstant { us: 0.0, error_us: 0.0 };
            ExposedImage { image: PendingImage { seq: 0, middle: seen, bytes: None, develop }, middle }
        };
        both([pending(), pending()]).expect("two images");
    }
}
