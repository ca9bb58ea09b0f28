//! Cross-validation: views are predicted by a calibration made without them.
//!
//! Residuals of the views used for a calibration are too small as a measure of its error; those of held-out views are
//! not (M. Stone, "Cross-validatory choice and assessment of statistical predictions", J. R. Stat. Soc. B 36(2), 1974).
//! Only the target's own pose is fitted to a held-out view; where the others show the target to bow, it bows there too.

use nalgebra::{Isometry3, SVector};
use rayon::prelude::*;
use vergence_rig::{AxisPosition, Rig};
use vergence_targets::TargetView;
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Length};

use crate::extrinsics::{Lenses, Pair, StereoView, inside, rms};
use crate::planar_pose::{target_pose, target_pose_of};
use crate::reprojection::{POSE, difference, moved};
use crate::schur_lm::{self, Equations, SchurOptions, SchurProblem};
use crate::{
    ExtrinsicsCalibration, ExtrinsicsError, ExtrinsicsOptions, FEWEST_STAGE_POSES, IntrinsicsCalibration,
    IntrinsicsError, IntrinsicsOptions, Side, StageError, StageOptions, StagePose, TargetShape, calibrate_extrinsics,
    calibrate_intrinsics, calibrate_stage,
};

/// Prediction error of held-out views.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// Number of parts the views were divided into; each was predicted by a calibration of the others.
    pub folds: usize,
    /// Distance between corners and reprojection, root mean square per corner over all held-out views. Corners that the
    /// calibration of all views left out do not count, nor do those outside the valid cone of the calibration that
    /// predicts them.
    pub rms_px: f64,
    /// The views that could be predicted.
    pub views: Vec<HeldOutView>,
}

impl Validation {
    /// Whether the held-out views fit nearly as well as the views used for the calibration, whose residual is `rms_px`.
    #[must_use]
    pub fn is_sound(&self, rms_px: f64) -> bool {
        /// Largest ratio that chance explains: with few views the calibration adapts to them.
        const MOST: f64 = 2.0;
        self.rms_px <= MOST * rms_px
    }
}

/// A view predicted by a calibration made without it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutView {
    /// Name of the view.
    pub view: String,
    /// Number of corners that count.
    pub corners: usize,
    /// Root mean square distance per corner, in pixels.
    pub rms_px: f64,
}

/// A stage pose predicted by a calibration made without it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutPose {
    /// Encoder readings.
    pub readings: Vec<AxisPosition>,
    /// Angle between the predicted orientation and that calibrated from this stage pose alone.
    pub rotation: Angle,
    /// Distance between the predicted position of the right camera and that calibrated from this stage pose alone.
    pub translation: Length,
    /// Squared Mahalanobis length of that difference: 6 on average if the covariances are right.
    pub chi_square: f64,
}

/// Holds out every `folds`th view in turn. `calibration` is that of all `views`.
///
/// # Errors
/// [`IntrinsicsError`] where the views that are left do not give a calibration.
pub fn validate_intrinsics(
    views: &[TargetView],
    size: ImageSize,
    options: &IntrinsicsOptions,
    calibration: &IntrinsicsCalibration,
    folds: usize,
) -> Result<Validation, IntrinsicsError> {
    let counts = |view: usize, corner: usize| {
        !calibration.outliers.iter().any(|outlier| (outlier.view, outlier.corner) == (view, corner))
    };
    validate(views, folds, |kept, held| {
        let found = calibrate_intrinsics(kept, size, options)?;
        let shape = found.warp.map_or(TargetShape::FLAT, |warp| warp.shape);
        let predict = |(index, view): &(usize, &TargetView)| {
            let corners = view.corners.iter().enumerate().filter(|(corner, _)| counts(*index, *corner));
            let clean = TargetView { name: view.name.clone(), corners: corners.map(|(_, corner)| *corner).collect() };
            let pose = target_pose_of(&found.camera, &clean, &shape).ok()?;
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
    let is_outlier = |name: &str, side: Side, target_mm: [f64; 2]| {
        calibration.outliers.iter().any(|out| {
            out.view == name && out.side == side && out.target_mm.map(f64::to_bits) == target_mm.map(f64::to_bits)
        })
    };
    validate(views, folds, |kept, held| {
        let pair = calibrate_extrinsics(left, right, kept, options)?;
        let predict = |(_, view): &(usize, &StereoView)| {
            let mut clean = (*view).clone();
            clean.left.corners.retain(|corner| !is_outlier(&view.name, Side::Left, corner.target_mm));
            clean.right.corners.retain(|corner| !is_outlier(&view.name, Side::Right, corner.target_mm));
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

/// Calls `fold` for every division of `views` into kept and held-out ones (with their indices).
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

/// Fits only the target's pose of `view` to the known `pair`. `None` if neither camera can place the target.
fn predicted(pair: &ExtrinsicsCalibration, view: &StereoView) -> Option<HeldOutView> {
    let usable = inside(&pair.left, &pair.right, view);
    let left_from_right = *pair.joint.left_from_right.isometry();
    let shape = pair.warp.map_or(TargetShape::FLAT, |warp| warp.shape);
    let known = Pair { left_from_right, lenses: Lenses::of(&pair.left, &pair.right), shape };
    let by_left = target_pose(&pair.left, &view.left).ok().map(|pose| *pose.camera_from_target.isometry());
    let by_right = target_pose(&pair.right, &view.right).ok();
    let by_right = by_right.map(|pose| left_from_right * pose.camera_from_target.isometry());
    let fitted = |start: Isometry3<f64>| {
        let problem = HeldTarget { pair: known, view, usable: &usable };
        let solution = schur_lm::solve(&problem, (), vec![start], &SchurOptions::default());
        solution.blocks.first().filter(|_| solution.cost.is_finite()).map(|target| (solution.cost, *target))
    };
    let fits = [by_left, by_right].into_iter().flatten().filter_map(fitted);
    let (_, target) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let errors_px = [known.errors_px(view, &target)];
    let corners = usable.iter().filter(|&&usable| usable).count();
    Some(HeldOutView { view: view.name.clone(), corners, rms_px: rms(&errors_px, &[usable])? })
}

/// Least-squares problem of one target's pose before a known pair.
struct HeldTarget<'a> {
    pair: Pair,
    view: &'a StereoView,
    /// In the order of [`StereoView::corners`].
    usable: &'a [bool],
}

impl SchurProblem<POSE> for HeldTarget<'_> {
    type Shared = ();
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        0
    }

    fn block_residuals(&self, (): &(), _: usize, target: &Isometry3<f64>, equations: &mut Equations<POSE>) {
        for ((side, corner), _) in self.view.corners().zip(self.usable).filter(|(_, usable)| **usable) {
            match self.pair.residual(side, corner, target) {
                Some(residual) => {
                    equations.add(&residual.error.into(), corner.relative_sigma, &[], &residual.by_target.into());
                }
                // An infinite cost refuses the step that led here.
                None => equations.add(&[f64::INFINITY; 2], 1.0, &[], &[[0.0; 2]; POSE]),
            }
        }
    }

    fn shared_plus(&self, (): &(), _: &[f64]) {}

    fn block_plus(&self, target: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(target, step)
    }
}
