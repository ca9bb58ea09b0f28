//! Positions, zones and cameras for reports: as JSON, cameras in words too.

use serde_json::{Map, Value, json};
use vergence_vision::{KannalaBrandt, OpenCvFisheye, Zones};

use crate::{AxisPosition, Rig};

/// Rounds for people and programs alike: a tenth of a micrometre or of a thousandth degree is below every encoder.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Axis positions as `{"baseline_mm": ..., "separation_deg": ...}`.
#[must_use]
pub fn axes_json(rig: &Rig, positions: &[AxisPosition]) -> Value {
    let entries = rig.axes.iter().zip(positions).map(|(axis, position)| match position {
        AxisPosition::Linear(length) => (format!("{}_mm", axis.name), json!(rounded(length.mm()))),
        AxisPosition::Rotary(angle) => (format!("{}_deg", axis.name), json!(rounded(angle.deg()))),
    });
    Value::Object(entries.collect::<Map<_, _>>())
}

/// Zones in degrees; an angle that is not a number becomes null.
#[must_use]
pub fn zones_json(zones: &Zones) -> Value {
    json!({
        "stereo": rounded(zones.stereo.deg()),
        "mono": rounded(zones.mono.deg()),
        "blind": rounded(zones.blind.deg()),
    })
}

/// Size, valid field and coefficients of a camera for people.
#[must_use]
pub fn camera_in_words(camera: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = camera.to_opencv();
    let size = camera.size();
    format!(
        "{} x {} px, valid to {:.2} from the axis\nfx {fx:.4}  fy {fy:.4}  cx {cx:.4}  cy {cy:.4}\n\
         opencv_k1 {k1:.6}  opencv_k2 {k2:.6}  opencv_k3 {k3:.6}  opencv_k4 {k4:.6}",
        size.width,
        size.height,
        camera.theta_max()
    )
}

/// Size, valid field and coefficients of a camera for programs.
#[must_use]
pub fn camera_json(camera: &KannalaBrandt) -> Value {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = camera.to_opencv();
    let size = camera.size();
    json!({
        "size": [size.width, size.height],
        "theta_max_deg": camera.theta_max().deg(),
        "opencv": {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "k1": k1, "k2": k2, "k3": k3, "k4": k4},
    })
}
