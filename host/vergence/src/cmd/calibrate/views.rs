//! Target views for the calibrations, from images or from a CSV file of corners.

use std::path::{Path, PathBuf};

use vergence_calibration::{IntrinsicsOptions, StereoView, TargetView, calibrate_intrinsics};
use vergence_calibration_report::{ReportAbout, ReportImage};
use vergence_rig::Provenance;
use vergence_vision::{Angle, KannalaBrandt};

use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::corners::{self, FrameView};
use crate::failure::Failure;
use crate::provenance::InputHash;
use crate::target_images::{MissedReason, PairedFiles, TargetImages, detect_in, files, paired};

/// Looks for the target in images and names those without one. Without a `hint`, a camera that is roughly right, it
/// looks twice: the second time with the lens that the first look gives.
///
/// # Errors
/// Images that cannot be read, or no target in any of them.
pub fn from_images(
    files: &[PathBuf],
    target: &TargetOptions,
    hint: Option<&KannalaBrandt>,
    hash: &mut InputHash,
    console: Console,
) -> Result<TargetImages, Failure> {
    let target = target.spec()?;
    for file in files {
        hash.add(file)?;
    }
    let progress = console.progress(&format!("looking for the target in {} images", files.len()));
    let mut targets = detect_in(files, &target, hint)?;
    if hint.is_none() {
        // Where the views give no lens, the calibration that follows says why.
        if let Ok(rough) = calibrate_intrinsics(&targets.found(), targets.size, &IntrinsicsOptions::default()) {
            targets = detect_in(files, &target, Some(&rough.camera))?.or(targets);
        }
    }
    progress.finish_and_clear();
    for missed in targets.missed() {
        match missed.reason {
            MissedReason::NoTarget(_) => console.say(missed)?,
            MissedReason::Damaged(_) => console.warn(missed.to_string()),
        }
    }
    if targets.found().is_empty() {
        let reason = targets.missed().next().map(ToString::to_string).unwrap_or_default();
        return Err(Failure::usage(format!("no target in any of {} images ({reason})", files.len())));
    }
    Ok(targets)
}

/// Images of a pair, as files, patterns or folders.
pub struct PairPatterns<'a> {
    pub left: &'a [String],
    pub right: &'a [String],
    pub target: &'a TargetOptions,
    /// The cameras, at least roughly.
    pub cameras: (&'a KannalaBrandt, &'a KannalaBrandt),
}

impl PairPatterns<'_> {
    /// The pairs in which both images show the target, and all paired images of either camera, reduced for a report;
    /// images without a partner are named.
    ///
    /// # Errors
    /// As [`from_images`]; images that do not pair up, or are not of the cameras' sizes.
    pub fn views(
        &self,
        hash: &mut InputHash,
        console: Console,
    ) -> Result<(Vec<StereoView>, [Vec<ReportImage>; 2]), Failure> {
        let PairedFiles { pairs: [left, right], alone } = paired([files(self.left)?, files(self.right)?])?;
        for file in alone {
            console.warn(format!("{}: left out: the other camera has no image of this number", file.display()));
        }
        let left = from_images(&left, self.target, Some(self.cameras.0), hash, console)?;
        let right = from_images(&right, self.target, Some(self.cameras.1), hash, console)?;
        for (name, images, camera) in [("left", left.size, self.cameras.0), ("right", right.size, self.cameras.1)] {
            if images != camera.size() {
                return Err(Failure::usage(format!(
                    "the {name} images are {} x {}, but the {name} camera is one of {} x {}: use the images that the \
                     camera was calibrated with",
                    images.width,
                    images.height,
                    camera.size().width,
                    camera.size().height
                )));
            }
        }
        let pairs = left.views.into_iter().zip(right.views);
        let views = pairs.filter_map(|(left, right)| Some(stereo_view(left.ok()?, right.ok()?))).collect();
        Ok((views, [left.images, right.images]))
    }
}

fn stereo_view(left: TargetView, right: TargetView) -> StereoView {
    StereoView { name: left.name.clone(), left, right }
}

/// Reads the pairs of a CSV file, by frame number: the frames in which both `cameras` have corners.
///
/// # Errors
/// Those of the file; other than two cameras.
pub fn pairs_from_corners(
    path: &Path,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<(i64, StereoView)>, Failure> {
    let names = |left: &str, right: &str| Ok((left.to_owned(), right.to_owned()));
    let (left, right) = match cameras {
        [] => names("left", "right"),
        [left, right] => names(left, right),
        _ => Err(Failure::usage("--cameras needs the names of two cameras in the CSV file")),
    }?;
    hash.add(path)?;
    let right: Vec<FrameView> = corners::read(path, Some(&right))?;
    let pair = |left: FrameView| {
        let right = right.iter().find(|right| right.frame == left.frame)?;
        Some((left.frame, stereo_view(left.view, right.view.clone())))
    };
    Ok(corners::read(path, Some(&left))?.into_iter().filter_map(pair).collect())
}

/// Reads the views of one camera from a CSV file.
///
/// # Errors
/// Those of the file.
pub fn from_corners(path: &Path, camera: Option<&str>, hash: &mut InputHash) -> Result<Vec<TargetView>, Failure> {
    hash.add(path)?;
    Ok(corners::read(path, camera)?.into_iter().map(|frame| frame.view).collect())
}

/// Heading of a report: title, origin and target. `half_field` is half the field of the lens by its data sheet.
#[must_use]
pub fn about(title: String, target: &TargetOptions, provenance: &Provenance, half_field: Option<Angle>) -> ReportAbout {
    let target = target.spec().map_or_else(
        |_| "as in the corner file".into(),
        |spec| format!("{} × {} inner corners, {}", spec.columns, spec.rows, spec.square),
    );
    ReportAbout {
        title,
        program_version: provenance.program.clone(),
        inputs_sha256: provenance.inputs_sha256.clone(),
        date: provenance.date.clone().unwrap_or_default(),
        target,
        half_field,
        ..ReportAbout::default()
    }
}
