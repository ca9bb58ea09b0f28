//! Residuals of a fit by corner and view.

use vergence_vision::{KannalaBrandt, Transform};

use crate::extrinsics::{
    ExtrinsicsError, Fit, Side, StereoOutlier, StereoOutlierReason, StereoView, StereoViewFigures,
};
use crate::reprojection::Lens;

/// Root mean square of the values for which `counted` holds; `None` without any.
pub(crate) fn rms(values: &[Vec<f64>], counted: &[Vec<bool>]) -> Option<f64> {
    root_mean_square(values.iter().flatten().zip(counted.iter().flatten()))
}

fn root_mean_square<'a>(errors: impl Iterator<Item = (&'a f64, &'a bool)>) -> Option<f64> {
    let add = |(sum, count): (f64, f64), (error, _): (&f64, &bool)| (sum + error * error, count + 1.0);
    let (sum, count) = errors.filter(|(_, counted)| **counted).fold((0.0, 0.0), add);
    (count > 0.0).then(|| (sum / count).sqrt())
}

/// The refined lens as a camera.
pub(crate) fn refined(lens: &Lens, camera: &KannalaBrandt, side: Side) -> Result<KannalaBrandt, ExtrinsicsError> {
    lens.camera(camera).map_err(|lens| ExtrinsicsError::Lens { side, lens })
}

pub(crate) fn view_figures<S>(views: &[StereoView], fit: &Fit<S>) -> Vec<StereoViewFigures> {
    let figures = |(index, view): (usize, &StereoView)| {
        let (errors, inliers) = (&fit.errors_px[index], &fit.inliers[index]);
        let middle = view.left.corners.len();
        let parts = [(&errors[..middle], &inliers[..middle]), (&errors[middle..], &inliers[middle..])];
        StereoViewFigures {
            view: view.name.clone(),
            left_from_target: Transform::from_isometry(fit.targets[index]),
            rms_px: parts.map(|(errors, inliers)| root_mean_square(errors.iter().zip(inliers))),
            corners: parts.map(|(_, inliers)| inliers.iter().filter(|&&inlier| inlier).count()),
        }
    };
    views.iter().enumerate().map(figures).collect()
}

/// The corners left out and why; `usable` are those inside the lens's valid cone.
pub(crate) fn outliers<S>(views: &[StereoView], usable: &[Vec<bool>], fit: &Fit<S>) -> Vec<StereoOutlier> {
    let mut outliers = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let rejected = !fit.inliers[index].contains(&true);
        for (place, (side, corner)) in view.corners().enumerate() {
            let reason = match (fit.inliers[index][place], usable[index][place]) {
                (true, _) => continue,
                (false, false) => StereoOutlierReason::OutsideField,
                (false, true) if rejected => StereoOutlierReason::ViewRejected,
                (false, true) => StereoOutlierReason::Gross,
            };
            outliers.push(StereoOutlier {
                view: view.name.clone(),
                side,
                target_mm: corner.target_mm,
                pixel: corner.pixel,
                error_px: fit.errors_px[index][place],
                reason,
            });
        }
    }
    outliers
}
