//! Positions, zones and cameras for reports: as JSON, cameras in words too.

use serde_json::{Map, Value, json};
use vergence_vision::{KannalaBrandt, OpenCvFisheye, Zones};

use crate::{AxisPosition, Rig, RigPose};

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

/// What a person should know of a trunk at this pose: that it is near a dead centre, how far its joints' readings are from a closed
/// loop. `None` where there is nothing to say, and of a rig without a trunk.
#[must_use]
pub fn closure_in_words(pose: &RigPose) -> Option<String> {
    let closure = pose.closure.as_ref()?;
    let near = closure.is_near_dead_centre.then(|| {
        format!(
            "near a dead centre of the trunk: its joints alone tell the pose to {:.2}° and {:.2} mm",
            pose.rotation_sigma.deg(),
            pose.translation_sigma.mm()
        )
    });
    let missed = (closure.missed >= TOLD).then(|| {
        format!(
            "the joints' readings miss a closed loop by {:.1} of their standard deviations, within noise",
            closure.missed
        )
    });
    let sentences: Vec<String> = near.into_iter().chain(missed).collect();
    (!sentences.is_empty()).then(|| sentences.join("; "))
}

/// A loop that is missed by less than this many standard deviations is not worth a word.
const TOLD: f64 = 0.05;

/// How the readings of a trunk fit its closed loop, for programs; null of a rig without a trunk.
#[must_use]
pub fn closure_json(pose: &RigPose) -> Value {
    pose.closure.as_ref().map_or(Value::Null, |closure| {
        json!({
            "near_dead_centre": closure.is_near_dead_centre,
            "missed_sigma": rounded(closure.missed),
            "joints_tell": {
                "rotation_deg": rounded(pose.rotation_sigma.deg()),
                "translation_mm": rounded(pose.translation_sigma.mm()),
            },
        })
    })
}

/// Size, valid field and coefficients of a camera for people.
#[must_use]
pub fn camera_in_words(camera: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = camera.to_opencv();
    let size = camera.size();
    let [e0, e1] = camera.pupil().mm();
    let pupil = if camera.is_central() { String::new() } else { format!("\npupil_e0_mm {e0:.4}  pupil_e1_mm {e1:.4}") };
    let asymmetry = if camera.is_symmetric() {
        String::new()
    } else {
        let [p1, p2, s0, s1, s2, s3, p3, p4] = camera.asymmetry().to_array();
        format!("\ntangential {p1:.6} {p2:.6} {p3:.6} {p4:.6}  prism {s0:.6} {s1:.6} {s2:.6} {s3:.6}")
    };
    let further = if camera.has_further_terms() {
        let [k5, k6] = camera.further_terms();
        format!("\nradial_k5 {k5:.8}  radial_k6 {k6:.8}")
    } else {
        String::new()
    };
    let model = camera.foreign_model().map_or_else(String::new, |model| {
        format!(
            "\ncomputed by the {} model; the numbers above are those of the polynomial that comes nearest",
            model.name()
        )
    });
    format!(
        "{} x {} px, valid to {:.2} from the axis\nfx {fx:.4}  fy {fy:.4}  cx {cx:.4}  cy {cy:.4}\n\
         opencv_k1 {k1:.6}  opencv_k2 {k2:.6}  opencv_k3 {k3:.6}  opencv_k4 {k4:.6}{pupil}{asymmetry}{further}{model}",
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
        "pupil_e0_mm": camera.pupil().e0.mm(),
        "pupil_e1_mm": camera.pupil().e1.mm(),
        "tangential": camera.asymmetry().tangential,
        "tangential_growth": camera.asymmetry().growth,
        "prism": camera.asymmetry().prism,
        "further_terms": camera.further_terms(),
        "model": camera.foreign_model().map(|model| {
            let values = model.parameters().into_iter().map(|parameter| (parameter.name, json!(parameter.value)));
            json!({"name": model.name(), "values": values.collect::<Map<_, _>>()})
        }),
    })
}
