//! A result of the live loop as a message: points that go into a buffer of the graphics card as they are, and why each is trusted.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use vergence_live::LiveResult;
use vergence_pipeline::{ColouredPoint, Observation, PairCloud};
use vergence_rig::{AxisPosition, RigPose, rounded};
use vergence_vision::{Base, Frame, Transform};

use crate::message::packed;
use crate::streams::Outgoing;

/// Opacity byte of a point that is measured in the field where both lenses are known, and of one where a lens is extrapolated.
const MEASURED: u8 = 255;
const EXTRAPOLATED: u8 = 128;

/// The message of a result.
///
/// Behind the header come for every point 16 bytes, x, y and z in millimetres in the frame of the left camera (32-bit floats), then red,
/// green, blue and 255, or 128 where a lens is extrapolated. Behind all of them come for every point 13 floats: the covariance in mm² (xx,
/// xy, xz, yy, yz, zz), its pixel in the left image (u, v) and in the right one, the standard deviation of its range in millimetres, how
/// far its rays miss each other in standard deviations, and the score of its match. All are little-endian.
#[must_use]
pub fn cloud_message(result: &LiveResult<'_>) -> Outgoing {
    let measurement = result.measurement;
    let mut header = json!({
        "kind": "cloud",
        "number": result.totals.clouds + result.totals.bearings,
        "latency_ms": rounded(result.latency.as_secs_f64() * 1e3),
        "work_ms": rounded(measurement.seconds * 1e3),
        "points_limit": result.limited.map(|limit| json!({ "most": limit.most, "of": limit.of })),
        "skipped": result.totals.skipped.values().sum::<u64>(),
    });
    match &measurement.observation {
        Observation::Points { cloud, pose, moving, by_images } => {
            describe(&mut header, cloud, pose, *moving);
            header["axes_by_images"] = by_images.len().into();
            packed(&header, &bytes_of(&cloud.points))
        }
        Observation::Bearings { side, bearings, why } => {
            header["count"] = 0.into();
            header["bearings"] = json!({
                "camera": side.to_string(), "count": bearings.len(), "why": why.to_string(),
            });
            packed(&header, &[])
        }
    }
}

fn describe(header: &mut Value, cloud: &PairCloud, pose: &RigPose, moving: bool) {
    let dropped: BTreeMap<&str, usize> =
        cloud.dropped.matches.iter().map(|(why, count)| (why.as_str(), *count)).collect();
    let unmatched: usize = cloud.dropped.keypoints.values().sum();
    let squares: f64 = cloud.points.iter().map(|point| misses(point).powi(2)).sum();
    let residual = (!cloud.points.is_empty()).then(|| rounded((squares / cloud.points.len() as f64).sqrt()));
    let axes: Vec<f64> = pose.axes.iter().copied().map(AxisPosition::mm_or_deg).map(rounded).collect();
    let right = pose.base_from_left * pose.left_from_right;
    for (name, value) in [
        ("base_from_left", json!(rows_of(&pose.base_from_left))),
        ("base_from_right", json!(rows_of(&right))),
        ("count", json!(cloud.points.len())),
        ("moving", json!(moving)),
        ("axes", json!(axes)),
        ("keypoints", json!(cloud.keypoints)),
        ("unmatched", json!(unmatched)),
        ("matches", json!(cloud.matches)),
        ("dropped", json!(dropped)),
        ("extrapolated", json!(cloud.extrapolated())),
        ("residual_sigmas", json!(residual)),
        ("told_by_pairs", json!(cloud.told_by_pairs)),
        ("pose_by_images", json!(cloud.fused_pose.is_some())),
        ("drifted", json!(cloud.significant_drift().is_some())),
        ("calibration_known", json!(!cloud.lacks_calibration)),
    ] {
        header[name] = value;
    }
}

/// A transform row by row, three rows of four numbers, in millimetres.
fn rows_of<F: Frame>(base_from_camera: &Transform<Base, F>) -> Vec<f64> {
    let (turn, at) = (base_from_camera.rotation().to_rotation_matrix(), base_from_camera.origin().mm());
    (0..3).flat_map(|row| [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)], at[row]]).collect()
}

/// How far the rays of a point miss each other, in standard deviations.
fn misses(point: &ColouredPoint) -> f64 {
    point.point.residual.rad() / point.point.residual_sigma.rad().max(f64::MIN_POSITIVE)
}

fn bytes_of(points: &[ColouredPoint]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(points.len() * (16 + 13 * 4));
    for ColouredPoint { point, colour: [red, green, blue], .. } in points {
        let at = point.point.mm();
        for value in [at.x, at.y, at.z] {
            bytes.extend_from_slice(&(value as f32).to_le_bytes());
        }
        bytes.extend_from_slice(&[*red, *green, *blue, if point.extrapolated { EXTRAPOLATED } else { MEASURED }]);
    }
    for coloured in points {
        let (point, c) = (&coloured.point, &coloured.point.covariance);
        let (left, right) = (point.pixels.left, point.pixels.right);
        let covariance = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| c[at]);
        let rest =
            [left.u, left.v, right.u, right.v, point.sigma_range.mm(), misses(coloured), f64::from(coloured.score)];
        for value in covariance.into_iter().chain(rest) {
            bytes.extend_from_slice(&(value as f32).to_le_bytes());
        }
    }
    bytes
}
