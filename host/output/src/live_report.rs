//! What a cloud of the live loop says, in one line for people and as JSON.

use serde_json::{Value, json};
use vergence_pipeline::{Bearing, CameraGone, LiveDense, PairCloud, PointLimit};
use vergence_rig::{Rig, RigPose, axes_json, rounded};
use vergence_vision::{Side, median};

use crate::{Table, dropped_json, pose_told_json};

/// How many points there are, how well their ranges are known in the median, where the axes of `rig` were, and how many pixels have a range.
#[must_use]
pub fn live_cloud_words(
    rig: &Rig,
    (cloud, dense): (&PairCloud, Option<&LiveDense>),
    pose: &RigPose,
    moving: bool,
) -> String {
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
    format!("{} points{extrapolated}{sigma}{place}{}", cloud.points.len(), dense.map(dense_words).unwrap_or_default())
}

fn dense_words(LiveDense { ranges, seconds, .. }: &LiveDense) -> String {
    let Some(ranges) = ranges else { return ", no ranges of all pixels while the cameras move".into() };
    let (measured, pixels) = (ranges.depth.counts().measured, ranges.depth.samples().len());
    let percent = 100.0 * measured as f64 / pixels.max(1) as f64;
    format!(", ranges of {measured} pixels ({percent:.0} %) in {:.0} ms", 1e3 * seconds)
}

/// What is measured of all pixels; null where they are not.
fn dense_json(dense: Option<&LiveDense>) -> Value {
    let Some(LiveDense { ranges: Some(ranges), seconds, .. }) = dense else { return Value::Null };
    let counts = ranges.depth.counts();
    json!({
        "measured": counts.measured,
        "far": counts.far,
        "pixels": ranges.depth.samples().len(),
        "work_ms": rounded(seconds * 1e3),
    })
}

/// To how many points time limits a pair, to go on with after a comma.
#[must_use]
pub fn point_limit_words(PointLimit { most, of, helps }: PointLimit) -> String {
    let in_vain = if helps { "" } else { " (fewer would not help: a pair takes the whole period without any)" };
    format!("points limited by time: {most} of {of}{in_vain}, ")
}

/// The same; null where there is time for all.
#[must_use]
pub fn point_limit_json(limit: Option<PointLimit>) -> Value {
    limit.map_or(Value::Null, |PointLimit { most, of, helps }| json!({ "most": most, "of": of, "helps": helps }))
}

/// The points, what became of the other matches, and by which pose of `rig` they were made.
#[must_use]
pub fn live_cloud_json(
    rig: &Rig,
    (cloud, dense): (&PairCloud, Option<&LiveDense>),
    pose: &RigPose,
    moving: bool,
) -> Value {
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
        "dense": dense_json(dense),
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
