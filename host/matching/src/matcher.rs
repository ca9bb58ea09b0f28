//! The interface of matchers: the pair of images and the matches.

use std::collections::BTreeMap;

use image::GrayImage;
use vergence_vision::{
    Angle, BodyMask, ImageSize, KannalaBrandt, Left, Length, MatchSigma, Pixel, PixelPair, Right, Side, Transform,
};

/// A matcher: finds the pixels of scene points that both images of a pair show.
///
/// What it finds depends on the pair alone, but for [`crate::TrackingMatcher`], which follows what it found in the pairs before.
pub trait Matcher: Send + Sync {
    /// A short name for logs and reports.
    fn name(&self) -> &str;

    /// Finds the matches of `pair`, in an order that depends on the input alone. Images without texture give no matches,
    /// which is not an error.
    ///
    /// # Errors
    /// [`MatchError`] for a pair that cannot be matched, whatever its images show.
    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError>;

    /// The number of points that it follows at most, if it can be told to do less; `None` by a matcher that does the whole work for every pair.
    fn most_points(&self) -> Option<usize> {
        None
    }

    /// As [`Self::find`], with no more than about `most` points, for less work, if it can be told so. Those are spread over the views.
    ///
    /// # Errors
    /// As [`Self::find`].
    fn find_at_most(&self, pair: &ImagePair<'_>, most: Option<usize>) -> Result<Matches, MatchError> {
        let _ = most;
        self.find(pair)
    }
}

/// Two images exposed together, with their lenses and their relative pose.
#[derive(Clone, Copy, Debug)]
pub struct ImagePair<'a> {
    /// The left camera's image.
    pub left: &'a GrayImage,
    /// The right camera's image.
    pub right: &'a GrayImage,
    /// The left lens and sensor.
    pub left_camera: &'a KannalaBrandt,
    /// The right lens and sensor.
    pub right_camera: &'a KannalaBrandt,
    /// The stated relative pose.
    pub left_from_right: Transform<Left, Right>,
    /// Standard deviation of the relative rotation. Zero trusts the pose; a larger one widens the epipolar band.
    pub pose_sigma: Angle,
    /// The smallest range from the left camera at which points are sought.
    pub nearest: Length,
    /// What of the left and of the right image shows the robot itself: nothing is sought there.
    pub masks: [Option<&'a BodyMask>; 2],
}

/// A match: the pixels of one scene point in both images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Pixel of the match in the left image.
    pub left: Pixel,
    /// Pixel of the match in the right image.
    pub right: Pixel,
    /// Standard deviations of both pixels, along the epipolar curve and across it. A match that is less probably right states larger ones.
    pub sigma: MatchSigma,
    /// Probability from 0 to 1 that the match is right: that its parallax is off by at most three standard deviations of such matches,
    /// which are smaller than the stated ones of a match that may be wrong.
    pub score: f32,
    /// Whether the position was registered, to a small part of a pixel; else its standard deviation is larger.
    pub registered: bool,
    /// The number of the track that shows the same place in the pairs before; `None` by a matcher that does not follow places.
    pub track: Option<u64>,
}

impl Match {
    /// The pair of pixels and its standard deviations, as [`vergence_vision::cloud_of_each`] takes them.
    #[must_use]
    pub const fn measured(&self) -> (PixelPair, MatchSigma) {
        (PixelPair { left: self.left, right: self.right }, self.sigma)
    }
}

/// The result of [`Matcher::find`]. Every left keypoint is either in `pairs` or counted in `dropped`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matches {
    /// The matches.
    pub pairs: Vec<Match>,
    /// Number of dropped left keypoints for each reason.
    pub dropped: BTreeMap<UnmatchedReason, usize>,
    /// Number of keypoints in the left image.
    pub left_keypoints: usize,
    /// Number of keypoints in the right image.
    pub right_keypoints: usize,
}

/// Why a left keypoint has no match, in the order of the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum UnmatchedReason {
    /// No right keypoint lies in the epipolar band, or none is similar enough.
    NoCandidate,
    /// Two distinct positions in the right image are about equally similar.
    Ratio,
    /// The right keypoint is more similar to another left keypoint.
    NotMutual,
    /// Registration did not converge, moved too far or left the field.
    NotRefined,
    /// The registered patches differ in more than gain and bias.
    LowCorrelation,
    /// The texture does not determine the position well enough.
    Uncertain,
    /// Registration back from right to left ends elsewhere.
    NotReversible,
    /// The registered position is off the epipolar curve or nearer than the nearest range.
    Epipolar,
    /// A view shows the same pattern again along the row.
    Repeated,
    /// No neighbours support the disparity.
    Isolated,
    /// A better match is at the same position.
    Duplicate,
    /// The windows in which it was registered probably show two surfaces: residuals, neighbouring windows and epipolar plane disagree.
    TwoSurfaces,
    /// A match of a network that could not be registered, and is wrong with a probability of 7 % or more.
    Doubtful,
}

impl UnmatchedReason {
    /// The reason in snake case, for reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NoCandidate => "no_candidate",
            Self::Ratio => "ratio",
            Self::NotMutual => "not_mutual",
            Self::NotRefined => "not_refined",
            Self::LowCorrelation => "low_correlation",
            Self::Uncertain => "uncertain",
            Self::NotReversible => "not_reversible",
            Self::Epipolar => "epipolar",
            Self::Repeated => "repeated",
            Self::Isolated => "isolated",
            Self::Duplicate => "duplicate",
            Self::TwoSurfaces => "two_surfaces",
            Self::Doubtful => "doubtful",
        }
    }
}

/// Why a pair of images cannot be matched.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// An image has no pixels.
    #[error("the {0} image is empty")]
    EmptyImage(Side),
    /// An image does not have the size that its camera is calibrated for.
    #[error(
        "the {side} image is {} x {}, its camera is calibrated for {} x {}",
        image.width, image.height, camera.width, camera.height
    )]
    ImageSize {
        /// The camera concerned.
        side: Side,
        /// The image's size.
        image: ImageSize,
        /// The camera's size.
        camera: ImageSize,
    },
    /// There are no epipolar curves: the cameras are at the same position, or the pose is not finite.
    #[error("the pose has no baseline: the two cameras must be apart")]
    NoBaseline,
    /// [`ImagePair::nearest`] is not positive and finite.
    #[error("the nearest range is {0}, it must be positive")]
    Nearest(Length),
    /// [`ImagePair::pose_sigma`] is negative or not finite.
    #[error("the pose's sigma is {0}, it must be zero or positive")]
    PoseSigma(Angle),
    /// The fields of view of the cameras do not overlap.
    #[error("the two cameras share no field of view")]
    NoSharedField,
    /// A network failed.
    #[error(transparent)]
    Network(#[from] crate::learned::network::NetworkError),
}

impl ImagePair<'_> {
    /// Checks sizes, range and uncertainty, without looking at the images' content.
    pub(crate) fn check(&self) -> Result<(), MatchError> {
        for (side, image, camera) in
            [(Side::Left, self.left, self.left_camera), (Side::Right, self.right, self.right_camera)]
        {
            let size = ImageSize { width: image.width(), height: image.height() };
            if size.width == 0 || size.height == 0 {
                return Err(MatchError::EmptyImage(side));
            }
            if size != camera.size() {
                return Err(MatchError::ImageSize { side, image: size, camera: camera.size() });
            }
        }
        if !(self.nearest.mm() > 0.0 && self.nearest.mm().is_finite()) {
            return Err(MatchError::Nearest(self.nearest));
        }
        if !(self.pose_sigma.rad() >= 0.0 && self.pose_sigma.rad().is_finite()) {
            return Err(MatchError::PoseSigma(self.pose_sigma));
        }
        Ok(())
    }
}
