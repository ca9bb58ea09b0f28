//! What a cloud of the live loop says, in one line for people and as JSON.

use serde_json::{Value, json};
use vergence_pipeline::{Bearing, CameraGone, PairCloud, PointLimit};
use vergence_rig::{Rig, RigPose, axes_json};
use vergence_vision::{Side, median};

use crate::{Table, dropped_json, pose_told_json};

/// How many points there are, how well their ranges are known in the median, and where the axes of `rig` were.
#[must_use]
pub fn live_cloud_words(rig: &Rig, cloud: &PairCloud, pose: &RigPose, moving: bool) -> String {
    let axes = rig.axes.iter().zip(&pose.axes).map(|(axis, at)| format!("{} {at:.2}", axis.name));
    let axes = axes.collect::<Vec<_>>().join(", ");
    let moving = if moving { ", moving" } else { "" };
    let place = if axes.is_empty() { String::new() } else { format!(" at {axes}{moving}") };
    let extrapolated = match cloud.extrapolated() {
        0 => String::new(),
        count => format!(", {count} of them extrapolated"),
    };
    let parts = cloud.points.iter().map(|point| point.point.sigma_range.mm() / point.point.point.mm().norm());
    let sigma = median(parts.collect()).map_or_else(String::new, |part| format!(", ranges to {:.1} %", 100.0 * part));
    format!("{} points{extrapolated}{sigma}{place}", cloud.points.len())
}

/// To how many points time limits a pair, to go on with after a comma.
#[must_use]
pub fn point_limit_words(PointLimit { most, of }: PointLimit) -> String {
    format!("points limited by time: {most} of {of}, ")
}

/// The same; null where there is time for all.
#[must_use]
pub fn point_limit_json(limit: Option<PointLimit>) -> Value {
    limit.map_or(Value::Null, |PointLimit { most, of }| json!({ "most": most, "of": of }))
}

/// The points, what became of the other matches, and by which pose of `rig` they were made.
#[must_use]
pub fn live_cloud_json(rig: &Rig, cloud: &PairCloud, pose: &RigPose, moving: bool) -> Value {
    let placed = pose.base_from_left;
    json!({
        "points": cloud.points.len(),
        "extrapolated": cloud.extrapolated(),
        "matches": cloud.matches,
        "dropped": dropped_json(&cloud.dropped),
        "axes": axes_json(rig, &pose.axes),
        "moving": moving,
        "beyond_calibration": rig.extrapolations(&pose.axes),
        "base_from_left": {
            "origin_mm": placed.origin().mm().as_slice(),
            "rotation_vector": placed.rotation().scaled_axis().as_slice(),
        },
        "pose_source": pose_told_json(pose, cloud),
        "cloud": Table::of_points(&cloud.points).json(),
    })
}

/// The bearings of the camera at `side`, and why the other camera gives nothing.
#[must_use]
pub fn live_bearings_json(side: Side, bearings: &[Bearing], why: &CameraGone) -> Value {
    json!({
        "camera": side.to_string(),
        "dead": { "camera": side.other().to_string(), "why": why.to_string() },
        "bearings": Table::of_bearings(bearings).json(),
    })
}
