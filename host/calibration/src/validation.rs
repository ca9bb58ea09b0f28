//! Held-out views: a calibration made without them tells where their corners are.
//!
//! Residuals of the views that a calibration was made of flatter it; those of views it never saw do not (M. Stone,
//! "Cross-validatory choice and assessment of statistical predictions", J. R. Stat. Soc. B 36(2), 1974). Only the board's
//! own pose is fitted to a held-out view.

use nalgebra::{Isometry3, SVector};
use rayon::prelude::*;
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Length};

use crate::arrow::{self, ArrowOptions, ArrowProblem, Equations};
use crate::extrinsics::{Lenses, Pair, StereoView, inside, rms};
use crate::planar_pose::board_pose;
use crate::reprojection::{POSE, difference, moved};
use crate::{
    BoardView, ExtrinsicsCalibration, ExtrinsicsError, ExtrinsicsOptions, FEWEST_STAGE_POSES, IntrinsicsCalibration,
    IntrinsicsError, IntrinsicsOptions, Side, StageError, StageOptions, StagePose, calibrate_extrinsics,
    calibrate_intrinsics, calibrate_stage,
};

/// How well views are predicted that the calibration did not see.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// The views were divided into so many parts; each was predicted by a calibration of the others.
    pub folds: usize,
    /// Distance between corners and reprojection, root mean square per corner over all held-out views. Corners that the
    /// calibration of all views left out do not count, nor do those outside the valid cone of one that did not see them.
    pub rms_px: f64,
    /// Each view that could be predicted.
    pub views: Vec<HeldOutView>,
}

impl Validation {
    /// Whether the held-out views fit nearly as well as `rms_px`, the residual of the views that the calibration was made
    /// of.
    #[must_use]
    pub fn is_sound(&self, rms_px: f64) -> bool {
        /// With few views the calibration adapts itself to them, which the degrees of freedom allow; more than this is
        /// no chance.
        const MOST: f64 = 2.0;
        self.rms_px <= MOST * rms_px
    }
}

/// A view predicted by a calibration that did not see it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutView {
    /// Its name.
    pub view: String,
    /// Corners that count.
    pub corners: usize,
    /// Root mean square distance per corner.
    pub rms_px: f64,
}

/// A stage pose predicted by a calibration that did not see it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutPose {
    /// What the encoders read.
    pub readings: Vec<AxisPosition>,
    /// The rotation between the prediction and the pose as calibrated by itself.
    pub rotation: Angle,
    /// The distance between the right camera's positions of both.
    pub translation: Length,
    /// The square of that difference in units of its covariance: 6 on average where the covariances are honest.
    pub chi_square: f64,
}

/// Holds out every `folds`th view in turn. `calibration` is that of all `views`.
///
/// # Errors
/// [`IntrinsicsError`] where the views that are left do not give a calibration.
pub fn validate_intrinsics(
    views: &[BoardView],
    size: ImageSize,
    options: &IntrinsicsOptions,
    calibration: &IntrinsicsCalibration,
    folds: usize,
) -> Result<Validation, IntrinsicsError> {
    let counts = |view: usize, corner: usize| {
        !calibration.outliers.iter().any(|outlier| (outlier.view, outlier.corner) == (view, corner))
    };
    validate(views, folds, |kept, held| {
        let lens = calibrate_intrinsics(kept, size, options)?.camera;
        let predict = |(index, view): &(usize, &BoardView)| {
            let corners = view.corners.iter().enumerate().filter(|(corner, _)| counts(*index, *corner));
            let clean = BoardView { name: view.name.clone(), corners: corners.map(|(_, corner)| *corner).collect() };
            let pose = board_pose(&lens, &clean).ok()?;
            Some(HeldOutView { view: clean.name, corners: pose.corners, rms_px: pose.rms_px })
        };
        Ok(held.iter().filter_map(predict).collect())
    })
}

/// Holds out every `folds`th view in turn. `calibration` is that of all `views`.
///
/// # Errors
/// [`ExtrinsicsError`] where the views that are left do not give a calibration.
pub fn validate_extrinsics(
    (left, right): (&KannalaBrandt, &KannalaBrandt),
    views: &[StereoView],
    options: &ExtrinsicsOptions,
    calibration: &ExtrinsicsCalibration,
    folds: usize,
) -> Result<Validation, ExtrinsicsError> {
    let is_outlier = |name: &str, side: Side, board_mm: [f64; 2]| {
        calibration.outliers.iter().any(|out| {
            out.view == name && out.side == side && out.board_mm.map(f64::to_bits) == board_mm.map(f64::to_bits)
        })
    };
    validate(views, folds, |kept, held| {
        let pair = calibrate_extrinsics(left, right, kept, options)?;
        let predict = |(_, view): &(usize, &StereoView)| {
            let mut clean = (*view).clone();
            clean.left.corners.retain(|corner| !is_outlier(&view.name, Side::Left, corner.board_mm));
            clean.right.corners.retain(|corner| !is_outlier(&view.name, Side::Right, corner.board_mm));
            predicted(&pair, &clean)
        };
        Ok(held.iter().filter_map(predict).collect())
    })
}

/// Leaves out one stage pose after the other.
///
/// # Errors
/// [`StageError`] where the stage poses that are left do not give a calibration.
pub fn validate_stage(rig: &Rig, poses: &[StagePose], options: &StageOptions) -> Result<Vec<HeldOutPose>, StageError> {
    if poses.len() <= FEWEST_STAGE_POSES {
        return Err(StageError::TooFewPoses(poses.len().saturating_sub(1)));
    }
    let without = |(index, held): (usize, &StagePose)| {
        let kept: Vec<StagePose> =
            poses.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, pose)| pose.clone()).collect();
        let stage = calibrate_stage(rig, &kept, options)?;
        let own = ExtrinsicsOptions { robust: options.robust, ..ExtrinsicsOptions::default() };
        let alone = calibrate_extrinsics(&stage.left, &stage.right, &held.views, &own)
            .map_err(|reason| StageError::Pose { pose: index + 1, reason })?;
        let predicted = stage.predict(&held.readings);
        let (there, here) = (predicted.left_from_right, alone.joint.left_from_right);
        let off = difference(there.isometry(), here.isometry());
        let weighed = (predicted.covariance + alone.covariance).cholesky().map(|factor| factor.solve(&off));
        Ok(HeldOutPose {
            readings: held.readings.clone(),
            rotation: Angle::from_rad(off.fixed_rows::<3>(0).norm()),
            translation: Length::from_mm(off.fixed_rows::<3>(3).norm()),
            chi_square: weighed.map_or(f64::INFINITY, |weighed| off.dot(&weighed)),
        })
    };
    poses.par_iter().enumerate().map(without).collect()
}

/// Runs `fold` on every division of `views` into kept and held-out ones (with their indices).
fn validate<V: Clone + Sync, E: Send>(
    views: &[V],
    folds: usize,
    fold: impl Fn(&[V], &[(usize, &V)]) -> Result<Vec<HeldOutView>, E> + Sync,
) -> Result<Validation, E> {
    let folds = folds.clamp(2, views.len().max(2));
    let parts: Vec<Vec<HeldOutView>> = (0..folds)
        .into_par_iter()
        .map(|part| {
            let (held, kept): (Vec<_>, Vec<_>) = views.iter().enumerate().partition(|(index, _)| index % folds == part);
            fold(&kept.into_iter().map(|(_, view)| view.clone()).collect::<Vec<_>>(), &held)
        })
        .collect::<Result<_, E>>()?;
    let views = parts.concat();
    let corners: usize = views.iter().map(|view| view.corners).sum();
    let squares: f64 = views.iter().map(|view| view.rms_px * view.rms_px * view.corners as f64).sum();
    Ok(Validation { folds, rms_px: (squares / corners.max(1) as f64).sqrt(), views })
}

/// How well `pair` explains a view when only the board may move. `None` where neither camera places the board.
fn predicted(pair: &ExtrinsicsCalibration, view: &StereoView) -> Option<HeldOutView> {
    let usable = inside(&pair.left, &pair.right, view);
    let left_from_right = *pair.joint.left_from_right.isometry();
    let known = Pair { left_from_right, lenses: Lenses::of(&pair.left, &pair.right) };
    let by_left = board_pose(&pair.left, &view.left).ok().map(|pose| *pose.camera_from_board.isometry());
    let by_right = board_pose(&pair.right, &view.right).ok();
    let by_right = by_right.map(|pose| left_from_right * pose.camera_from_board.isometry());
    let fitted = |start: Isometry3<f64>| {
        let problem = HeldBoard { pair: known, view, usable: &usable };
        let solution = arrow::solve(&problem, (), vec![start], &ArrowOptions::default());
        solution.blocks.first().filter(|_| solution.cost.is_finite()).map(|board| (solution.cost, *board))
    };
    let fits = [by_left, by_right].into_iter().flatten().filter_map(fitted);
    let (_, board) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let errors_px = [known.errors_px(view, &board)];
    let corners = usable.iter().filter(|&&usable| usable).count();
    Some(HeldOutView { view: view.name.clone(), corners, rms_px: rms(&errors_px, &[usable])? })
}

/// One board seen by a pair that is known.
struct HeldBoard<'a> {
    pair: Pair,
    view: &'a StereoView,
    /// In the order of [`StereoView::corners`].
    usable: &'a [bool],
}

impl ArrowProblem<POSE> for HeldBoard<'_> {
    type Shared = ();
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        0
    }

    fn block_residuals(&self, (): &(), _: usize, board: &Isometry3<f64>, equations: &mut Equations<POSE>) {
        for ((side, corner), _) in self.view.corners().zip(self.usable).filter(|(_, usable)| **usable) {
            match self.pair.residual(side, corner, board) {
                Some(residual) => {
                    equations.add(&residual.error.into(), corner.relative_sigma, &[], &residual.by_board.into());
                }
                // An infinite cost refuses the step that led here.
                None => equations.add(&[f64::INFINITY; 2], 1.0, &[], &[[0.0; 2]; POSE]),
            }
        }
    }

    fn shared_plus(&self, (): &(), _: &[f64]) {}

    fn block_plus(&self, board: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(board, step)
    }
}
