//! What becomes of images: exposures to measure, and reasons for those that are skipped.

use vergence_rig::BoardInstant;
use vergence_vision::Side;

/// An image and the middle of the exposure of its middle row.
#[derive(Clone, Debug, PartialEq)]
pub struct ExposedImage<T> {
    /// The image.
    pub image: T,
    /// The middle of the exposure, on the clock of the [`super::TimeBase`].
    pub middle: BoardInstant,
}

/// Images ready to be measured: a pair, or one image where the other camera is gone.
#[derive(Clone, Debug, PartialEq)]
pub enum Exposed<T> {
    /// The images of both cameras (left, right), exposed together.
    Pair(Box<[ExposedImage<T>; 2]>),
    /// The image of one camera, because the other is gone.
    One {
        /// The camera that delivered it.
        side: Side,
        /// Image of that camera.
        image: Box<ExposedImage<T>>,
        /// Why the other camera is gone.
        why: CameraGone,
    },
}

/// Why a camera delivers nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraGone {
    /// It has delivered nothing yet.
    #[error("it has not answered yet")]
    Unknown,
    /// It failed; the driver gave this reason.
    #[error("{0}")]
    Failed(String),
}

/// Images that may belong to either of two pulses: the instant of their exposure is not known well enough for the rate of the
/// trigger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambiguity {
    /// The camera.
    pub side: Side,
    /// How much longer than the period of the trigger the uncertainty is, in microseconds.
    pub excess_us: f64,
}

/// Why images are not measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SkipReason {
    /// Host and board have not compared their clocks yet.
    ClockUnknown,
    /// No pulse fired the camera when the image was exposed, or its report was lost.
    ImageWithoutPulse,
    /// The image may belong to either of two pulses.
    ImageOfEitherPulse,
    /// Neither camera delivered an image of the pulse.
    NoImageOfPulse,
    /// The right camera delivered, the left one did not.
    LeftImageLost,
    /// The left camera delivered, the right one did not.
    RightImageLost,
    /// Free-running cameras: the image lies halfway between two of the other camera.
    OutOfStep,
    /// A newer exposure came before the matcher was free.
    NewerCame,
    /// The encoder readings for the exposure did not arrive in time.
    EncodersSilent,
    /// The link to the board ended: before the images of the pulse were known, too long ago, or while the axes moved, so that nobody knows where they
    /// are.
    LinkEnded,
    /// The encoder readings do not cover the exposure, or an axis moved that no encoder tells.
    EncodersUnknown,
    /// No encoder tells an axis, and the images do not tell it either.
    AxesUntold,
}

impl SkipReason {
    /// The other camera's image is missing, where that of `side` is there.
    pub(super) const fn partner_lost(side: Side) -> Self {
        match side {
            Side::Left => Self::RightImageLost,
            Side::Right => Self::LeftImageLost,
        }
    }

    /// Whether it counts exposures; else it counts images, whose pulses have a count of their own.
    #[must_use]
    pub const fn is_of_pulse(self) -> bool {
        !matches!(self, Self::ImageWithoutPulse | Self::ImageOfEitherPulse)
    }

    /// The reason in snake case, for reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::ClockUnknown => "clock_unknown",
            Self::ImageWithoutPulse => "image_without_pulse",
            Self::ImageOfEitherPulse => "image_of_either_pulse",
            Self::NoImageOfPulse => "no_image_of_pulse",
            Self::LeftImageLost => "left_image_lost",
            Self::RightImageLost => "right_image_lost",
            Self::OutOfStep => "out_of_step",
            Self::NewerCame => "newer_came",
            Self::EncodersSilent => "encoders_silent",
            Self::LinkEnded => "link_ended",
            Self::EncodersUnknown => "encoders_unknown",
            Self::AxesUntold => "axes_untold",
        }
    }
}
