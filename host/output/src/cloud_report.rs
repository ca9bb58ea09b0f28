//! What is said of a cloud: what was dropped, and whether the images contradict the pose.

use std::path::Path;

use serde_json::{Map, Value, json};
use vergence_alignment::{FusedPose, LensGrowth, PoseDrift};
use vergence_pipeline::{AxisByImages, DenseRanges, Dropped, PairCloud};
use vergence_rig::{Rig, RigPose, rounded};

/// Where a pose comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseSource {
    /// The encoders of the rig.
    Encoders,
    /// The command line.
    CommandLine,
    /// The rig file, whose rig does not move.
    RigFile,
}

impl PoseSource {
    /// Where `vergence depth` has the pose of `rig` from.
    #[must_use]
    pub fn of_photographs(rig: &Rig) -> Self {
        if rig.axes.is_empty() { Self::RigFile } else { Self::CommandLine }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Encoders => "the encoders",
            Self::CommandLine => "the pose on the command line",
            Self::RigFile => "the pose in the rig file",
        }
    }

    const fn remedy(self) -> &'static str {
        match self {
            Self::Encoders => "calibrate again or check the mounts",
            Self::CommandLine => "check --mode, --baseline and --separation, or calibrate again",
            Self::RigFile => "calibrate again, or check that the images belong to this rig",
        }
    }
}

/// A sentence where the images disagree with the lenses or with the pose by more than their stated uncertainty.
#[must_use]
pub fn drift_warning(cloud: &PairCloud, source: PoseSource) -> Option<String> {
    if let Some(LensGrowth { growth, .. }) = cloud.significant_growth() {
        let (percent, how) = (1e2 * growth.abs(), if *growth > 0.0 { "longer" } else { "shorter" });
        return Some(format!(
            "the lenses look {percent:.2} % {how} than calibrated: temperature, focus, or a calibration that does not fit them; nothing was \
             corrected; calibrate them again as they are now"
        ));
    }
    let PoseDrift { angle, .. } = cloud.significant_drift()?;
    Some(format!("{} and the images disagree by {angle:.2}: nothing was corrected; {}", source.name(), source.remedy()))
}

/// The same for ranges of every pixel, with what the disagreement may mean for them.
#[must_use]
pub fn dense_drift_warning(ranges: &DenseRanges, pose: &RigPose, source: PoseSource) -> Option<String> {
    let PoseDrift { angle, .. } = ranges.significant_drift()?;
    // A turn by δ across the rows moves the parallax of about B / r by up to δ.
    let per_metre = 100.0 * angle.rad() * 1000.0 / pose.left_from_right.origin().mm().norm();
    Some(format!(
        "{} and the images disagree by {angle:.2}: partners were sought where the images show them, but ranges are by that pose; \
         beyond their sigma they may be wrong by up to {per_metre:.1} % for each metre of range; {}",
        source.name(),
        source.remedy()
    ))
}

/// The relative pose of a cloud with its covariance, where it comes from, and how many of its six components the joints and the images
/// told. `pose` is that by which the cloud was made.
#[must_use]
pub fn pose_source_json(pose: &RigPose, fused: Option<&FusedPose>) -> Value {
    let mut told = match fused {
        None => json!({ "from": "joints" }),
        Some(fused) => json!({
            "from": "joints and images",
            "told_by_joints": rounded(fused.told_by_joints()),
            "told_by_images": rounded(fused.told_by_images),
            "agreeing_matches": rounded(fused.agreeing),
            "match_variance_factor": rounded(fused.variance_factor),
        }),
    };
    told["rotation_sigma_deg"] = rounded(pose.rotation_sigma.deg()).into();
    told["left_from_right"] = json!({
        "origin_mm": pose.left_from_right.origin().mm().as_slice(),
        "rotation_vector": pose.left_from_right.rotation().scaled_axis().as_slice(),
    });
    let rows: Vec<Vec<f64>> = pose.covariance().row_iter().map(|row| row.iter().copied().collect()).collect();
    told["covariance"] = json!(rows);
    told
}

/// [`pose_source_json`] with the number of pairs that told the pose.
#[must_use]
pub fn pose_told_json(pose: &RigPose, cloud: &PairCloud) -> Value {
    let mut told = pose_source_json(pose, cloud.fused_pose.as_ref());
    if cloud.fused_pose.is_some() {
        told["pairs"] = cloud.told_by_pairs.into();
        told["earlier_visits"] = cloud.told_by_visits.into();
    }
    told
}

/// Who told the pose, such as "pose by joints 2.1, images 3.9 of 6, 3 pairs, ± 0.02°"; `None` where the joints told it alone.
#[must_use]
pub fn pose_told_words(cloud: &PairCloud) -> Option<String> {
    let fused = cloud.fused_pose.as_ref()?;
    let counted = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let before = if cloud.told_by_visits > 0 {
        format!(" and {}", counted(cloud.told_by_visits, "earlier visit"))
    } else {
        String::new()
    };
    Some(format!(
        "pose by joints{before} {:.1}, images {:.1} of 6, {}, ± {:.2}",
        fused.told_by_joints(),
        fused.told_by_images,
        counted(cloud.told_by_pairs, "pair"),
        fused.rotation_sigma()
    ))
}

/// Where the images say that axes stand, such as "separation 60.02° ± 0.02°"; `None` where encoders tell all of them.
#[must_use]
pub fn axes_by_images_words(rig: &Rig, axes: &[AxisByImages]) -> Option<String> {
    let named = axes.iter().filter_map(|told| Some((rig.axes.get(told.axis)?, told)));
    let words: Vec<_> = named.map(|(axis, told)| format!("{} {} ± {}", axis.name, told.at, told.sigma)).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

/// The same for programs: `{"separation": {"at": 60.02, "sigma": 0.02, "unit": "deg"}}`.
#[must_use]
pub fn axes_by_images_json(rig: &Rig, axes: &[AxisByImages]) -> Value {
    let entry = |told: &AxisByImages| {
        let axis = rig.axes.get(told.axis)?;
        let unit = if axis.column().ends_with("_mm") { "mm" } else { "deg" };
        let [at, sigma] = [told.at, told.sigma].map(|position| rounded(position.mm_or_deg()));
        Some((axis.name.clone(), json!({ "at": at, "sigma": sigma, "unit": unit })))
    };
    Value::Object(axes.iter().filter_map(entry).collect())
}

/// A line about the pose, where the images told a part of it.
#[must_use]
pub fn pose_source_line(fused: Option<&FusedPose>) -> Option<String> {
    let fused = fused?;
    Some(format!(
        "  pose by joints and images: of its 6 components the images told {:.1}, the joints {:.1}; the rotation is known to {:.2}",
        fused.told_by_images,
        fused.told_by_joints(),
        fused.rotation_sigma()
    ))
}

/// A line where the uncertainty of the points lacks the part of the calibration.
#[must_use]
pub fn calibration_line(is_calibration_known: bool) -> Option<String> {
    (!is_calibration_known).then(|| {
        "  calibration uncertainty unknown: sigma tells of pixels and encoders alone; calibrate, or state [calibration_sigma] in \
         the rig file"
            .into()
    })
}

/// A line where points lie beyond the field in which a lens was measured.
#[must_use]
pub fn extrapolated_line(count: usize) -> Option<String> {
    (count > 0).then(|| {
        format!(
            "  {count} of them lie where a lens was not measured but extrapolated: their column 'extrapolated' is 1"
        )
    })
}

/// Whether the uncertainty of the points has the part of the calibration.
#[must_use]
pub const fn calibration_json(is_calibration_known: bool) -> &'static str {
    if is_calibration_known { "included" } else { "unknown" }
}

/// `{"keypoints": {...}, "matches": {...}}`, each with a count for every reason that occurred.
#[must_use]
pub fn dropped_json(dropped: &Dropped) -> Value {
    let keypoints: Map<_, _> = dropped.keypoints.iter().map(|(why, n)| (why.as_str().to_owned(), json!(n))).collect();
    let matches: Map<_, _> = dropped.matches.iter().map(|(why, n)| (why.as_str().to_owned(), json!(n))).collect();
    json!({ "keypoints": keypoints, "matches": matches })
}

/// How far the images say that the pose is off.
pub(crate) fn drift_json(drift: Option<&PoseDrift>) -> Option<Value> {
    drift.map(|drift| {
        json!({
            "deg": rounded(drift.angle.deg()),
            "chi_squared": rounded(drift.chi_squared),
            "significant": drift.is_significant(),
        })
    })
}

/// How much longer than calibrated the images say that the lenses are.
fn growth_json(growth: Option<&LensGrowth>) -> Option<Value> {
    growth.map(|growth| {
        json!({
            "percent": rounded(1e2 * growth.growth),
            "sigma_percent": rounded(1e2 * growth.sigma),
            "significant": growth.is_significant(),
        })
    })
}

/// What is counted of a cloud that was written to `out`, the `pose` by which it was made, and its drift.
#[must_use]
pub fn cloud_json(cloud: &PairCloud, pose: &RigPose, out: &Path) -> Value {
    json!({
        "points": cloud.points.len(),
        "extrapolated": cloud.extrapolated(),
        "matches": cloud.matches,
        "keypoints": cloud.keypoints,
        "dropped": dropped_json(&cloud.dropped),
        "pose": pose_source_json(pose, cloud.fused_pose.as_ref()),
        "pose_drift": drift_json(cloud.pose_drift.as_ref()),
        "lens_growth": growth_json(cloud.lens_growth.as_ref()),
        "calibration_uncertainty": calibration_json(!cloud.lacks_calibration),
        "out": out,
    })
}

/// What is said of a cloud beside its number of points: extrapolated ones, what was dropped, and what is known of calibration and pose.
#[must_use]
pub fn cloud_lines(cloud: &PairCloud) -> Vec<String> {
    let mut lines: Vec<String> = extrapolated_line(cloud.extrapolated()).into_iter().collect();
    lines.extend(dropped_lines(&cloud.dropped));
    lines.extend(calibration_line(!cloud.lacks_calibration));
    lines.extend(pose_source_line(cloud.fused_pose.as_ref()));
    lines
}

/// One line for the keypoints without a match and one for the matches without a point, where there are any.
#[must_use]
pub fn dropped_lines(dropped: &Dropped) -> Vec<String> {
    let keypoints: Vec<_> = dropped.keypoints.iter().map(|(why, &count)| (why.as_str(), count)).collect();
    let matches: Vec<_> = dropped.matches.iter().map(|(why, &count)| (why.as_str(), count)).collect();
    let line = |what: &str, counts: &[(&str, usize)]| {
        let total: usize = counts.iter().map(|(_, count)| count).sum();
        let reasons: Vec<_> = counts.iter().map(|(why, count)| format!("{why} {count}")).collect();
        (total > 0).then(|| format!("  {total} {what}: {}", reasons.join(", ")))
    };
    [line("keypoints without a match", &keypoints), line("matches without a point", &matches)]
        .into_iter()
        .flatten()
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};
    use vergence_vision::Angle;

    use super::*;

    #[test]
    fn a_pose_without_encoders_is_not_blamed_on_them() {
        let drift = PoseDrift {
            correction: Vector6::zeros(),
            covariance: Matrix6::identity(),
            angle: Angle::from_deg(1.5),
            chi_squared: 400.0,
            agreeing: 0.9,
        };
        let cloud = PairCloud { pose_drift: Some(drift), ..PairCloud::default() };
        let said = |source| drift_warning(&cloud, source).expect("a significant drift");
        assert!(said(PoseSource::Encoders).starts_with("the encoders and the images disagree by 1.50"));
        for source in [PoseSource::CommandLine, PoseSource::RigFile] {
            assert!(!said(source).contains("encoder") && said(source).contains("1.50"), "{}", said(source));
        }
        let slight = PairCloud { pose_drift: Some(PoseDrift { chi_squared: 1.0, ..drift }), ..PairCloud::default() };
        assert_eq!(drift_warning(&slight, PoseSource::Encoders), None);
    }

    #[test]
    fn lenses_that_grew_are_blamed_and_not_the_pose() {
        let grown =
            |growth| PairCloud { lens_growth: Some(LensGrowth { growth, sigma: 1e-4 }), ..PairCloud::default() };
        let said = |growth| drift_warning(&grown(growth), PoseSource::Encoders);
        assert!(said(1.2e-3).expect("a warning").starts_with("the lenses look 0.12 % longer"));
        assert!(said(-3e-3).expect("a warning").starts_with("the lenses look 0.30 % shorter"));
        assert_eq!(said(4e-4), None);
    }
}
