//! A range for every pixel of the left image of a pair.

use std::path::Path;

use serde_json::Value;
use vergence_camera::CameraImage;
use vergence_matching::{DenseCounts, Gap, GuidedMatcher};
use vergence_output::{
    DenseCloud, PoseSource, calibration_json, calibration_line, dense_drift_warning, pose_source_json, pose_source_line,
};
use vergence_pipeline::{PairImages, StageTimes, dense_ranges, pose_by_images, with_fused};

use super::Measured;
use crate::cmd::force_option::ForceOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;
use vergence_plausibility::images::{Taken, images_are_one_pair};

/// Where a smaller part of the pixels that both cameras see has a range, the keypoints are asked whether the images are a pair.
/// Pairs that were taken together have 49 % to 82 % (a photographed pair, two simulated ones), swapped or unrelated ones at most 19 %.
const SUSPICIOUS_SHARE: f64 = 0.35;

/// Measures one pair and writes the cloud to `out`, as text where that is true, and images beside it.
pub fn one_dense_pair(
    [left, right]: [&CameraImage; 2],
    taken: Taken<'_>,
    out: (&Path, bool),
    force: ForceOption,
    console: Console,
) -> Result<Measured, Failure> {
    let Taken { rig, search, .. } = taken;
    let pose = taken.pose.at_middle();
    let images = PairImages { left: &left.image, right: &right.image };
    let mut times = StageTimes::start(clock);
    let fail = |error: &dyn std::fmt::Display| Failure::usage(format!("{} and {}: {error}", left.name, right.name));
    let fused = pose_by_images(images, (rig, search), pose, &GuidedMatcher::default()).map_err(|error| fail(&error))?;
    let used = &fused.map_or_else(|| pose.clone(), |fused| with_fused(pose, &fused));
    let ranges =
        dense_ranges(images, (rig, search), used, &mut |stage| times.ended(stage)).map_err(|error| fail(&error))?;
    if is_suspicious(&ranges.depth.counts()) {
        let found = images_are_one_pair([left, right], taken);
        force.unless_forced(found, console)?;
    }
    let written = DenseCloud::write(&ranges, &times, images, (rig, used), out)?;
    console.say(written.in_words())?;
    console
        .say_lines(calibration_line(used.is_calibration_known).into_iter().chain(pose_source_line(fused.as_ref())))?;
    if let Some(warning) = dense_drift_warning(&ranges, used, PoseSource::of_photographs(rig)) {
        console.warn(format!("{} and {}: {warning}", left.name, right.name));
    }
    let mut result: Value = written.json();
    result["calibration_uncertainty"] = calibration_json(used.is_calibration_known).into();
    result["pose"] = pose_source_json(used, fused.as_ref());
    Ok(Measured { result, fused, is_empty: written.is_empty() })
}

fn is_suspicious(counts: &DenseCounts) -> bool {
    let gaps: usize = [Gap::Inconsistent, Gap::Untextured].iter().filter_map(|gap| counts.gaps.get(gap)).sum();
    let measured = counts.measured + counts.far;
    (measured as f64) < SUSPICIOUS_SHARE * (measured + gaps) as f64
}
