//! The result of the calibration of a camera as lines of text and as JSON.

use serde_json::{Value, json};
use vergence_calibration::IntrinsicsCalibration;
use vergence_targets::TargetView;
use vergence_vision::OpenCvFisheye;

const NAMES: [&str; 8] = ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"];

fn parameters(calibration: &IntrinsicsCalibration) -> [f64; 8] {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = calibration.opencv;
    [fx, fy, cx, cy, k1, k2, k3, k4]
}

fn sigma(calibration: &IntrinsicsCalibration) -> [f64; 8] {
    std::array::from_fn(|index| calibration.covariance[(index, index)].max(0.0).sqrt())
}

/// The result of the calibration of a camera from `views` as lines for people.
#[must_use]
pub fn intrinsics_lines(calibration: &IntrinsicsCalibration, views: &[TargetView]) -> Vec<String> {
    let mut lines = vec![format!(
        "{} of {} corners in {} of {} views: {:.3} px rms ({:.3} px with the outliers), valid to {:.2} from the axis",
        calibration.corners_inlier,
        calibration.corners_total,
        calibration.views_used,
        views.len(),
        calibration.rms_inlier_px,
        calibration.rms_px,
        calibration.camera.theta_max()
    )];
    for ((name, value), sigma) in NAMES.iter().zip(parameters(calibration)).zip(sigma(calibration)) {
        lines.push(format!("  {name} {value:12.5} ± {sigma:.5}"));
    }
    for outlier in &calibration.outliers {
        let name = views.get(outlier.view).map_or("", |view| &view.name);
        let residual = outlier.residual_px.map(|px| format!(" ({px:.2} px)")).unwrap_or_default();
        lines.push(format!("  left out: corner {} of {name}, {}{residual}", outlier.corner, outlier.reason));
    }
    lines
}

/// The result of the calibration of a camera for programs; `seconds` is how long it took.
#[must_use]
pub fn intrinsics_json(calibration: &IntrinsicsCalibration, seconds: f64) -> Value {
    let named = |values: [f64; 8]| -> Value {
        NAMES
            .iter()
            .zip(values)
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let views: Vec<_> = calibration
        .views
        .iter()
        .map(|view| {
            json!({
                "name": view.name,
                "corners": view.corners,
                "corners_inlier": view.corners_inlier,
                "rms_px": view.rms_px,
                "rms_inlier_px": view.rms_inlier_px,
            })
        })
        .collect();
    json!({
        "rms_px": calibration.rms_px,
        "rms_inlier_px": calibration.rms_inlier_px,
        "corners_total": calibration.corners_total,
        "corners_inlier": calibration.corners_inlier,
        "views_used": calibration.views_used,
        "theta_max_deg": calibration.camera.theta_max().deg(),
        "pixel_sigma": calibration.sigma0_px,
        "view_scatter": calibration.view_scatter,
        "opencv": named(parameters(calibration)),
        "sigma": named(sigma(calibration)),
        "seconds": seconds,
        "views": views,
    })
}
