//! What every matcher takes and returns.

use std::collections::BTreeMap;

use image::GrayImage;
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Length, Pixel, PixelPair, Right, Side, Transform};

/// Finds the points of the scene seen in both images of a pair.
pub trait Matcher: Send + Sync {
    /// A short name for logs and reports.
    fn name(&self) -> &str;

    /// The homologous points of `pair`, in an order that depends on the pair alone. Images without texture give no
    /// matches, which is not an error.
    ///
    /// # Errors
    /// [`MatchError`] where the pair cannot be matched whatever its images show.
    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError>;
}

/// Two images exposed together, the lenses that made them and what is known of the relative pose.
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
    /// The relative pose, as far as it is known.
    pub left_from_right: Transform<Left, Right>,
    /// Standard deviation of the relative rotation's error. Zero trusts the pose; more widens the epipolar band.
    pub pose_sigma: Angle,
    /// The nearest range from the left camera at which a point may lie.
    pub nearest: Length,
}

/// One point of the scene in both images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Where the left image shows it.
    pub left: Pixel,
    /// Where the right image shows it.
    pub right: Pixel,
    /// Standard deviation of each coordinate of both positions, in pixels of the images, as if both were equally uncertain.
    pub sigma: f64,
    /// Likeness in [0, 1], comparable within one matcher only.
    pub score: f32,
}

impl Match {
    /// Both positions and their standard deviation, as triangulation takes them.
    #[must_use]
    pub const fn measured(&self) -> (PixelPair, f64) {
        (PixelPair { left: self.left, right: self.right }, self.sigma)
    }
}

/// The result of [`Matcher::find`]. Every left keypoint is either in `pairs` or counted in `dropped`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matches {
    /// The homologous points.
    pub pairs: Vec<Match>,
    /// How many left keypoints were given up, by reason.
    pub dropped: BTreeMap<Drop, usize>,
    /// Keypoints found in the left image.
    pub left_keypoints: usize,
    /// Keypoints found in the right image.
    pub right_keypoints: usize,
}

/// Why a left keypoint has no match, in the order of the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Drop {
    /// No right keypoint lies in the epipolar band, or none looks alike.
    NoCandidate,
    /// Two distinct places in the right image look about equally alike.
    Ratio,
    /// The right keypoint prefers another left keypoint.
    NotMutual,
    /// Registration did not converge, moved too far or left the field.
    NotRefined,
    /// The registered patches differ in more than gain and bias.
    LowCorrelation,
    /// The texture does not fix the position well enough.
    Uncertain,
    /// Registration back from right to left ends elsewhere.
    NotReversible,
    /// The registered position is off the epipolar curve or nearer than the nearest range.
    Epipolar,
    /// A view shows the same elsewhere along the row.
    Repeated,
    /// No neighbours support the disparity.
    Isolated,
    /// Another match has the same place.
    Duplicate,
}

impl Drop {
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
        }
    }
}

/// Why a pair cannot be matched.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// An image has no pixels.
    #[error("the {0} image is empty")]
    EmptyImage(Side),
    /// An image is not of its camera's size.
    #[error(
        "the {side} image is {} x {}, its camera is calibrated for {} x {}",
        image.width, image.height, camera.width, camera.height
    )]
    ImageSize {
        /// Which camera.
        side: Side,
        /// The image's size.
        image: ImageSize,
        /// The camera's size.
        camera: ImageSize,
    },
    /// The cameras are at the same place, or the pose is not finite: there are no epipolar curves.
    #[error("the pose has no baseline: the two cameras must be apart")]
    NoBaseline,
    /// The nearest range is not positive and finite.
    #[error("the nearest range is {0}, it must be positive")]
    Nearest(Length),
    /// The uncertainty of the pose is negative or not finite.
    #[error("the pose's sigma is {0}, it must be zero or positive")]
    PoseSigma(Angle),
    /// No direction is seen by both cameras.
    #[error("the two cameras share no field of view")]
    NoSharedField,
    /// A network failed.
    #[error(transparent)]
    Network(#[from] crate::learned::NetworkError),
}

impl ImagePair<'_> {
    /// Checks what can be told without looking at the images' content.
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
