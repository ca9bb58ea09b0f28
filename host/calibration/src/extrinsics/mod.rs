//! The relative pose of two cameras from boards that both see, by their bundles of rays; nothing is rectified.
//!
//! Each camera places the board on its own ([`board_pose`](crate::board_pose)), Arun's fit between the two corner clouds
//! gives a first relative pose, and all of it is refined jointly on the reprojection of every corner. It works the same
//! where the board is seen only near and beyond 90°.

mod fit;
mod gross;
mod initial;
mod joint;
mod report;
mod stereo;

use nalgebra::SMatrix;
use vergence_vision::{InvalidLens, KannalaBrandt, Left, Pixel, Right, Transform};

use crate::board::{Board, BoardView, Corner};
use crate::planar_pose::PoseError;
use crate::reprojection::POSE;

pub(crate) use fit::{Fit, NoFit, Start, Task};
pub(crate) use gross::OwnPoses;
pub(crate) use initial::{PlacedView, inside, nearer_boards, place};
pub(crate) use joint::{FixedPose, Kinematics, Shared};
pub(crate) use report::{outliers, refined, rms, view_figures};
pub use stereo::LensKnowledge;
pub(crate) use stereo::{Lenses, Pair};
pub use vergence_vision::Side;

/// Fewer views cannot contradict each other.
pub const FEWEST_VIEWS: usize = 3;

/// One board seen by both cameras while neither moved against the other. Corners may be missing in either image.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoView {
    /// For reports.
    pub name: String,
    /// What the left camera saw.
    pub left: BoardView,
    /// What the right camera saw.
    pub right: BoardView,
}

/// How to calibrate.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsOptions {
    /// What is known of the lenses.
    pub lenses: LensKnowledge,
    /// Whether gross corners are found by a robust loss and left out.
    pub robust: bool,
}

impl Default for ExtrinsicsOptions {
    /// The lenses as given, robust.
    fn default() -> Self {
        Self { lenses: LensKnowledge::Exact, robust: true }
    }
}

/// A relative pose and how well it fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePose {
    /// The right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// Distance between corners and reprojection, root mean square per corner of both cameras.
    pub rms_px: f64,
}

/// The calibrated pair.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtrinsicsCalibration {
    /// Arun's fit, each board as one camera places it.
    pub arun: RelativePose,
    /// The joint optimum; its `rms_px` is over all corners, gross ones too.
    pub joint: RelativePose,
    /// Of `joint` in local coordinates `[ω, δ]`: rotation vector about the left axes in radians, then the position of the
    /// right camera in the left frame in millimetres.
    pub covariance: SMatrix<f64, POSE, POSE>,
    /// Over the corners that are not gross.
    pub rms_inlier_px: f64,
    /// Standard deviation of one pixel coordinate, root mean square over those corners.
    pub sigma_px: f64,
    /// The left lens, refined unless it was exact.
    pub left: KannalaBrandt,
    /// The right lens, refined unless it was exact.
    pub right: KannalaBrandt,
    /// Corners of all views that took part, both cameras.
    pub corners_total: usize,
    /// Those of them that are not gross.
    pub corners_inlier: usize,
    /// Each view that took part.
    pub views: Vec<StereoViewFigures>,
    /// Each corner left out.
    pub outliers: Vec<StereoOutlier>,
    /// Each view that did not take part.
    pub skipped: Vec<SkippedView>,
}

/// How one view fits.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoViewFigures {
    /// Its name.
    pub view: String,
    /// The board in the left frame.
    pub left_from_board: Transform<Left, Board>,
    /// Root mean square of the left and of the right camera's corners that are not gross; `None` without any.
    pub rms_px: [Option<f64>; 2],
    /// Corners that are not gross, of the left and of the right camera.
    pub corners: [usize; 2],
}

/// A corner left out.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoOutlier {
    /// The view's name.
    pub view: String,
    /// The camera.
    pub side: Side,
    /// Where the corner is on the board, in millimetres.
    pub board_mm: [f64; 2],
    /// Where the image shows it.
    pub pixel: Pixel,
    /// How far that is from where it should be.
    pub error_px: f64,
    /// Why it is left out.
    pub reason: StereoOutlierReason,
}

/// Why a corner is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StereoOutlierReason {
    /// Much further than the others from where the rest of its own image puts it.
    Gross,
    /// Outside the lens's valid cone.
    OutsideField,
    /// The cameras disagree on the whole view, or too few of its corners were left.
    ViewRejected,
}

/// A view that says nothing of the relative pose.
#[derive(Clone, Debug, PartialEq)]
pub struct SkippedView {
    /// Its name.
    pub view: String,
    /// The camera that does not place the board.
    pub side: Side,
    /// Why not.
    pub reason: PoseError,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtrinsicsError {
    /// The two lists of views differ in length.
    #[error("{left} views of the left camera and {right} of the right do not pair")]
    ViewsDoNotPair {
        /// Views of the left camera.
        left: usize,
        /// Views of the right camera.
        right: usize,
    },
    /// Too few views in which both cameras place the board.
    #[error("{usable} views in which both cameras see enough of the board; at least {FEWEST_VIEWS} are needed")]
    TooFewViews {
        /// Those there are.
        usable: usize,
    },
    /// A view contradicts itself.
    #[error("view '{view}', {side} camera: {reason}")]
    View {
        /// Its name.
        view: String,
        /// The camera.
        side: Side,
        /// What is wrong.
        reason: PoseError,
    },
    /// The corners leave an unknown open: too few views for lenses that are free, or all boards alike.
    #[error("the views do not determine the calibration: add boards at other places and tilts, or hold the lenses")]
    NotDetermined,
    /// The iteration ended at no optimum.
    #[error("the views contradict each other: no relative pose fits them")]
    Diverged,
    /// A covariance of a lens is not symmetric and positive.
    #[error("the covariance of a lens is not positive definite")]
    LensCovariance,
    /// The refined parameters are not a lens.
    #[error("the refined {side} lens: {lens}")]
    Lens {
        /// The camera.
        side: Side,
        /// Why not.
        lens: InvalidLens,
    },
}

impl From<NoFit> for ExtrinsicsError {
    fn from(reason: NoFit) -> Self {
        match reason {
            NoFit::NotDetermined => Self::NotDetermined,
            NoFit::Diverged => Self::Diverged,
            NoFit::NotACovariance => Self::LensCovariance,
        }
    }
}

impl StereoView {
    /// Pairs the images of two cameras in their order. A view is called after its left image.
    ///
    /// # Errors
    /// [`ExtrinsicsError::ViewsDoNotPair`] where one camera has more than the other.
    pub fn pair(left: &[BoardView], right: &[BoardView]) -> Result<Vec<Self>, ExtrinsicsError> {
        if left.len() != right.len() {
            return Err(ExtrinsicsError::ViewsDoNotPair { left: left.len(), right: right.len() });
        }
        let pair = |(left, right): (&BoardView, &BoardView)| Self {
            name: left.name.clone(),
            left: left.clone(),
            right: right.clone(),
        };
        Ok(left.iter().zip(right).map(pair).collect())
    }

    /// All corners, the left camera's first.
    pub fn corners(&self) -> impl Iterator<Item = (Side, &Corner)> {
        let left = self.left.corners.iter().map(|corner| (Side::Left, corner));
        left.chain(self.right.corners.iter().map(|corner| (Side::Right, corner)))
    }
}

/// Calibrates the relative pose of two cameras, and their lenses if the options let them move.
///
/// First values by A. Arun et al. 1987 on the boards as each camera places them; then least squares on the reprojection
/// over the relative pose, every board pose and the lenses: with Huber's loss until near, then without it and without the
/// corners that are more than six medians from where the rest of their own image puts them.
///
/// # Errors
/// [`ExtrinsicsError`] where views are too few, contradict themselves or leave an unknown open.
pub fn calibrate_extrinsics(
    left: &KannalaBrandt,
    right: &KannalaBrandt,
    views: &[StereoView],
    options: &ExtrinsicsOptions,
) -> Result<ExtrinsicsCalibration, ExtrinsicsError> {
    let lenses = Lenses::of(left, right);
    let (placed, skipped) = place(left, right, views)?;
    if placed.len() < FEWEST_VIEWS {
        return Err(ExtrinsicsError::TooFewViews { usable: placed.len() });
    }
    let arun = initial::arun(views, &placed)?;
    let boards = nearer_boards(lenses, &arun, views, &placed);
    let views: Vec<StereoView> = placed.iter().filter_map(|place| views.get(place.view)).cloned().collect();
    let usable: Vec<Vec<bool>> = views.iter().map(|view| inside(left, right, view)).collect();
    let own_poses: Vec<OwnPoses> = placed.iter().map(PlacedView::own_poses).collect();
    let task = Task {
        kinematics: &FixedPose,
        views: &views,
        own_poses: &own_poses,
        lenses,
        knowledge: &options.lenses,
        robust: options.robust,
    };
    let arun_errors = task.errors_px(&Shared { state: arun, lenses }, &boards);
    let fit = task.fit(Start { shared: Shared { state: arun, lenses }, boards, usable: usable.clone() })?;

    let covariance = fit.covariance.as_ref().ok_or(ExtrinsicsError::NotDetermined)?;
    let relative = |pose, rms_px| RelativePose { left_from_right: Transform::from_isometry(pose), rms_px };
    let every = rms(&fit.errors_px, &usable).unwrap_or_default();
    Ok(ExtrinsicsCalibration {
        arun: relative(arun, rms(&arun_errors, &usable).unwrap_or_default()),
        joint: relative(fit.shared.state, every),
        covariance: covariance.fixed_view::<POSE, POSE>(0, 0).into_owned(),
        rms_inlier_px: rms(&fit.errors_px, &fit.inliers).unwrap_or_default(),
        sigma_px: fit.sigma_px(&views),
        left: refined(&fit.shared.lenses.left, left, Side::Left)?,
        right: refined(&fit.shared.lenses.right, right, Side::Right)?,
        corners_total: usable.iter().map(Vec::len).sum(),
        corners_inlier: fit.inliers.iter().flatten().filter(|&&inlier| inlier).count(),
        views: view_figures(&views, &fit),
        outliers: outliers(&views, &usable, &fit),
        skipped,
    })
}
