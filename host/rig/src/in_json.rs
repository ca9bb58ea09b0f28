//! Positions and zones as JSON, for reports.

use serde_json::{Map, Value, json};
use vergence_vision::Zones;

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
