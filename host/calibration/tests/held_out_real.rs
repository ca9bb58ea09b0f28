//! Views of real lenses that no calibration saw: predicted by the lenses that this program fits, and by the splined ones that mrcal fitted
//! to all views. Only the pose of the target is fitted to such a view. The data live outside the repository, see `tests/common/data.rs`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod intrinsics_sets;

use intrinsics_sets::{CornerSet, corner_sets, data};
use nalgebra::{Isometry3, Matrix2x3, Matrix6, SMatrix, Translation3, UnitQuaternion, Vector2, Vector6};
use rayon::prelude::*;
use vergence_calibration::{
    IntrinsicsOptions, LensModel, LensParameters, TargetShape, TargetWarp, calibrate_intrinsics, reproject, target_pose,
};
use vergence_targets::TargetView;
use vergence_vision::{Camera, KannalaBrandt, Point};

const FOLDS: usize = 5;

/// The shape of the target that a calibration found.
fn shape(warp: Option<TargetWarp>) -> TargetShape {
    warp.map_or(TargetShape::FLAT, |warp| warp.shape)
}

/// The sum of the squared residuals of `view` in a pose, with the normal equations of a small turn and shift of it.
type Residuals = (f64, Matrix6<f64>, Vector6<f64>);

fn residuals(lens: LensParameters, view: &TargetView, shape: &TargetShape, pose: &Isometry3<f64>) -> Option<Residuals> {
    let (mut squares, mut normal, mut right) = (0.0, Matrix6::zeros(), Vector6::zeros());
    for corner in &view.corners {
        let turned = pose.rotation * shape.point_mm(corner.target_mm);
        let seen = reproject(lens, &Point::from_mm(turned + pose.translation.vector))?;
        let off = Vector2::from(seen.pixel) - Vector2::new(corner.pixel.u, corner.pixel.v);
        let by_point = Matrix2x3::from(seen.by_point);
        let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
        by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_point * -turned.cross_matrix()));
        by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
        squares += off.norm_squared();
        normal += by_pose.transpose() * by_pose;
        right -= by_pose.transpose() * off;
    }
    Some((squares, normal, right))
}

/// The sum of the squared residuals of `view` at its best pose, by Levenberg's method.
fn predicted(camera: &KannalaBrandt, shape: &TargetShape, view: &TargetView) -> f64 {
    let lens = LensParameters::of(camera);
    let mut pose = *target_pose(camera, view).unwrap().camera_from_target.isometry();
    let mut here = residuals(lens, view, shape, &pose).unwrap();
    let mut damping = 1e-6;
    for _ in 0..60 {
        let damped = here.1 + Matrix6::from_diagonal(&(here.1.diagonal() * damping));
        let step = damped.cholesky().unwrap().solve(&here.2);
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let shift = Translation3::from(pose.translation.vector + step.fixed_rows::<3>(3));
        let moved = Isometry3::from_parts(shift, turn * pose.rotation);
        match residuals(lens, view, shape, &moved) {
            Some(there) if there.0 <= here.0 => {
                let is_done = here.0 - there.0 <= 1e-12 * here.0;
                (pose, here, damping) = (moved, there, damping * 0.1);
                if is_done {
                    break;
                }
            }
            _ => damping *= 10.0,
        }
    }
    here.0
}

/// Root mean square of residuals in pixels, of views and the sums of their squares.
fn rms_px<'a>(views: impl IntoIterator<Item = (&'a TargetView, f64)>) -> f64 {
    let add = |(corners, sum), (view, squares): (&TargetView, f64)| (corners + view.corners.len(), sum + squares);
    let (corners, squares) = views.into_iter().fold((0, 0.0), add);
    (squares / corners as f64).sqrt()
}

/// Every fifth view predicted by the calibration of the others, in turn.
fn held_out(set: &CornerSet, options: &IntrinsicsOptions) -> f64 {
    let fold = |fold: usize| {
        let (held, kept): (Vec<_>, Vec<_>) = set.views.iter().enumerate().partition(|(view, _)| view % FOLDS == fold);
        let kept: Vec<TargetView> = kept.into_iter().map(|(_, view)| view.clone()).collect();
        let found = calibrate_intrinsics(&kept, set.size, options).unwrap();
        let shape = shape(found.warp);
        held.into_iter().map(|(_, view)| (view, predicted(&found.camera, &shape, view))).collect::<Vec<_>>()
    };
    rms_px((0..FOLDS).into_par_iter().map(fold).collect::<Vec<_>>().into_iter().flatten())
}

/// The set without the corners that a central calibration of all views leaves out.
fn cleaned(set: CornerSet) -> CornerSet {
    let found = calibrate_intrinsics(&set.views, set.size, &IntrinsicsOptions::central()).unwrap();
    let mut views = set.views;
    for outlier in found.outliers.iter().rev() {
        views[outlier.view].corners.remove(outlier.corner);
    }
    CornerSet { views, ..set }
}

/// What mrcal fitted to all views of a set.
fn splined(name: &str) -> Option<KannalaBrandt> {
    let file = match name {
        "sourishg_stereo left" => "sourishg_stereo/mrcal_spline_left_29frames.cameramodel",
        "sourishg_stereo right" => "sourishg_stereo/mrcal_spline_right_29frames.cameramodel",
        "ocam_fisheye1 cam" => "ocam_fisheye1/mrcal_spline.cameramodel",
        _ => return None,
    };
    let text = std::fs::read_to_string(data::real_data(&format!("data/{file}"))?).unwrap();
    Some(vergence_exchange::read(&text).unwrap().cameras[0].lens().unwrap().lens)
}

/// A view without the corners beyond the field of `lens`.
fn within(lens: &KannalaBrandt, view: &TargetView) -> TargetView {
    let corners =
        view.corners.iter().filter(|corner| lens.unproject::<Camera>(corner.pixel).is_ok()).copied().collect();
    TargetView { name: view.name.clone(), corners }
}

/// The views of a set that a calibration did not see are predicted better by what the others ask for than by a lens with one centre and a flat
/// target.
#[test]
fn held_out_views_are_predicted_no_worse_than_by_one_centre() {
    // The largest set takes most of the time.
    let is_asked_for = |set: &CornerSet| std::env::var_os("VERGENCE_SEEDS").is_some() || set.name != "ov_plane cam";
    for set in corner_sets().into_iter().filter(is_asked_for).map(cleaned) {
        let by = |model, warp| held_out(&set, &IntrinsicsOptions { model, warp, outlier_factor: None });
        let [flat, bowed] = [false, true].map(|warp| by(LensModel::Central, warp));
        let found = by(LensModel::ByEvidence, false);
        let spline = splined(&set.name).map_or_else(String::new, |lens| {
            // Its field ends where mrcal's valid region does.
            let seen: Vec<TargetView> = set.views.iter().map(|view| within(&lens, view)).collect();
            let all = rms_px(seen.iter().map(|view| (view, predicted(&lens, &TargetShape::FLAT, view))));
            assert!(all < flat, "{}: {all} px, {flat}", set.name);
            format!(
                "; mrcal's spline, which saw all: {all:.4} at {} corners",
                seen.iter().map(|view| view.corners.len()).sum::<usize>()
            )
        });
        println!(
            "{}: central {flat:.4} px, with a bow of the target {bowed:.4}, by evidence {found:.4}{spline}",
            set.name
        );
        assert!(found < flat && found <= 1.01 * bowed, "{}: {found} px instead of {flat} and {bowed}", set.name);
    }
}
