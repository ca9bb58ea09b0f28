//! The path of a folding trunk, for people and for programs.

use serde_json::{Value, json};
use vergence_rig::linkage::{Leg, LegSample, TrunkPath, TrunkShape};
use vergence_rig::{AxisPosition, Rig, RigTrunk, axes_json, rounded};

/// Legs and room of the path in words.
#[must_use]
pub fn trunk_path_lines(path: &TrunkPath) -> Vec<String> {
    let leg_line = |(number, leg): (usize, &Leg)| {
        Some(format!("leg {}: {:.2} s to corners {}", number + 1, leg.seconds, degrees(leg.end()?)))
    };
    let mut lines: Vec<_> = path.legs.iter().enumerate().filter_map(leg_line).collect();
    lines.push(format!(
        "takes {:.2} s; every driven joint may be off by {:.1} degrees, bodies stay {:.1} mm apart",
        path.seconds(),
        path.kept.loop_reserve.to_degrees(),
        path.kept.gap_mm
    ));
    let tight = |leg: &Leg| leg.samples.iter().any(|sample| !sample.room.has(&path.kept));
    if path.legs.iter().any(tight) {
        let near = "one end is near a dead centre of the linkage: the path leaves or enters it where the reserve grows fastest";
        lines.push(near.to_owned());
    }
    lines
}

fn degrees(shape: &TrunkShape) -> String {
    let corners = ["A", "B", "C", "D", "E", "F"].into_iter().zip(shape.corners.0);
    let text: Vec<_> = corners.map(|(name, angle)| format!("{name} {:.1}", angle.to_degrees())).collect();
    let folds = if shape.is_flat() { String::new() } else { format!(", folds {:.1}", shape.fold.to_degrees()) };
    text.join(", ") + &folds
}

/// Every tenth shape of the leg of this number, from 0, and the last, as a table.
#[must_use]
pub fn trunk_leg_table(number: usize, leg: &Leg) -> String {
    let head =
        format!("leg {}   share   A       B       C       D       E       F     folds reserve  gap mm", number + 1);
    let last = leg.samples.len().saturating_sub(1);
    let rows =
        leg.samples.iter().enumerate().filter(|(index, _)| index % 10 == 0 || *index == last).map(|(_, sample)| {
            let all = sample.shape.corners.0.into_iter().chain([sample.shape.fold]);
            let angles: String = all.map(|angle| format!(" {:7.2}", angle.to_degrees())).collect();
            format!(
                "        {:5.2} {angles} {:7.2} {:7.1}",
                sample.share,
                sample.room.loop_reserve.to_degrees(),
                sample.room.gap.mm
            )
        });
    std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n")
}

/// The leg of a path for programs: its seconds, where it ends, and the least room on it.
#[must_use]
pub fn trunk_leg_json(rig: &Rig, trunk: &RigTrunk, leg: &Leg) -> Value {
    let least = |value: fn(&LegSample) -> f64| leg.samples.iter().map(value).fold(f64::INFINITY, f64::min);
    let to = leg.end().map(|shape| {
        let values = trunk.values_of(shape, rig.axes.len());
        let positions: Vec<_> =
            rig.axes.iter().zip(values).map(|(axis, value)| AxisPosition::from_value(axis.kind, value)).collect();
        axes_json(rig, &positions)
    });
    json!({
        "duration_s": rounded(leg.seconds),
        "to": to,
        "least_reserve_deg": rounded(least(|sample| sample.room.loop_reserve).to_degrees()),
        "least_gap_mm": rounded(least(|sample| sample.room.gap.mm)),
    })
}
