//! The plan of an axis as a table and as JSON.

use serde_json::{Value, json};
use vergence_protocol::AxisKind;
use vergence_rig::{RigAxis, rounded};

use crate::move_plan::AxisPlan;

impl AxisPlan {
    /// The knots as a table that can be compared line by line, in millimetres or degrees.
    #[must_use]
    pub fn table(&self, axis: &RigAxis) -> String {
        let (unit, scale) = unit(axis.kind);
        let mut text = format!("\n{}\n", axis.name);
        let heads = ["time s".into(), unit.into(), format!("{unit}/s"), format!("{unit}/s2"), format!("{unit}/s3")];
        text += &row(&heads);
        for knot in &self.knots {
            let [position, velocity, acceleration, jerk] =
                [knot.position, knot.velocity, knot.acceleration, knot.jerk].map(|value| scale * value);
            let numbers = [(knot.time, 5), (position, 4), (velocity, 4), (acceleration, 3), (jerk, 1)];
            text += &row(&numbers.map(|(number, digits)| plain(number, digits)));
        }
        text.trim_end().to_owned()
    }

    /// The knots for programs, in millimetres or degrees.
    #[must_use]
    pub fn json(&self, axis: &RigAxis) -> Value {
        let (unit, scale) = unit(axis.kind);
        let segments = self.knots.iter().map(|knot| {
            json!({
                "time_s": knot.time,
                "position": rounded(scale * knot.position),
                "velocity": rounded(scale * knot.velocity),
                "acceleration": rounded(scale * knot.acceleration),
                "jerk": rounded(scale * knot.jerk),
            })
        });
        json!({ "axis": axis.name, "unit": unit, "segments": segments.collect::<Vec<_>>() })
    }
}

/// Millimetres, or degrees in place of radians.
fn unit(kind: AxisKind) -> (&'static str, f64) {
    match kind {
        AxisKind::Linear => ("mm", 1.0),
        AxisKind::Rotary => ("deg", 1f64.to_degrees()),
    }
}

fn row(cells: &[String; 5]) -> String {
    let [time, position, velocity, acceleration, jerk] = cells;
    format!("  {time:>10} {position:>12} {velocity:>12} {acceleration:>12} {jerk:>12}\n")
}

/// A number with fixed digits; what rounds to zero has no sign.
fn plain(number: f64, digits: usize) -> String {
    let text = format!("{number:.digits$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').to_owned() } else { text }
}
