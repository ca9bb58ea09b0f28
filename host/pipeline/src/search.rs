//! Where in a pair of images points are sought.

use vergence_rig::RigPose;
use vergence_vision::{BodyMask, Length, Pixel, Side};

/// The nearest range at which points are sought, unless a caller says otherwise, in baselines.
const NEAREST_BASELINES: f64 = 1.0;

/// Ranges between which points are sought, and parts of both images that are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Search {
    /// The nearest range from the left camera; `None` is one baseline.
    pub nearest: Option<Length>,
    /// The farthest range of a point; `None` is as far as its parallax is significant.
    pub farthest: Option<Length>,
    /// What the robot's own body, a hood or the mount hides in the left and in the right image.
    pub masks: [Option<BodyMask>; 2],
}

/// Everywhere within the default ranges.
pub(crate) static EVERYWHERE: Search = Search { nearest: None, farthest: None, masks: [None, None] };

/// Ranges between which nothing can be sought. The message names the options of the command line.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidSearch {
    /// A range is none.
    #[error("--{name} {range}: a range is positive, such as 150mm")]
    Range {
        /// The name of its option: `nearest` or `farthest`.
        name: &'static str,
        /// The range.
        range: Length,
    },
    /// The nearest range is not nearer than the farthest.
    #[error("--nearest {nearest} leaves nothing before --farthest {farthest}")]
    Empty {
        /// The nearest range.
        nearest: Length,
        /// The farthest range.
        farthest: Length,
    },
}

impl Search {
    /// Points are sought between these ranges, but not where the `masks` of the left and the right camera hide them.
    ///
    /// # Errors
    /// [`InvalidSearch`] where a range is not positive, or nothing lies between them.
    pub fn between(
        nearest: Option<Length>,
        farthest: Option<Length>,
        masks: [Option<BodyMask>; 2],
    ) -> Result<Self, InvalidSearch> {
        for (name, range) in [("nearest", nearest), ("farthest", farthest)] {
            if let Some(range) = range.filter(|range| range.mm().is_nan() || range.mm() <= 0.0) {
                return Err(InvalidSearch::Range { name, range });
            }
        }
        match (nearest, farthest) {
            (Some(nearest), Some(farthest)) if nearest >= farthest => Err(InvalidSearch::Empty { nearest, farthest }),
            _ => Ok(Self { nearest, farthest, masks }),
        }
    }

    /// The nearest range that is sought with the cameras at `pose`.
    pub(crate) fn nearest_at(&self, pose: &RigPose) -> Length {
        let baseline = pose.left_from_right.origin().mm().norm();
        // Cameras at one place are refused for that, not for a nearest range of zero.
        self.nearest.unwrap_or(Length::from_mm((NEAREST_BASELINES * baseline).max(f64::MIN_POSITIVE)))
    }

    /// The mask of the camera on `side`.
    pub(crate) const fn mask(&self, side: Side) -> Option<&BodyMask> {
        match side {
            Side::Left => self.masks[0].as_ref(),
            Side::Right => self.masks[1].as_ref(),
        }
    }

    /// Whether a mask hides a pixel of the camera on `side`.
    pub(crate) fn hides(&self, side: Side, pixel: Pixel) -> bool {
        self.mask(side).is_some_and(|mask| mask.hides(pixel))
    }
}
