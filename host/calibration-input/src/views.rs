//! Views of targets for the calibrations, from images or from a CSV file of corners.

use std::path::{Path, PathBuf};

use vergence_calibration::{IntrinsicsOptions, StereoView, calibrate_intrinsics, label_pairs};
use vergence_calibration_report::{LeftOut, ReportImage};
use vergence_camera::{PairedFiles, paired};
use vergence_rig::CameraMask;
use vergence_targets::{SeenTarget, TargetKind, TargetView};
use vergence_vision::{KannalaBrandt, Side};

use crate::InputError;
use crate::corners::{FrameView, read_corners};
use crate::image_files::named_images;
use crate::input_hash::InputHash;
use crate::target_images::{Missed, Sought, TargetImages, detect_in};

/// What happens while images are looked at.
#[derive(Clone, Copy, Debug)]
pub enum ViewEvent<'a> {
    /// The target is looked for in so many images.
    Looking(usize),
    /// All images have been looked at.
    Looked,
    /// This image gives no view.
    Missed(&'a Missed),
    /// This pair of images is left out: its labels are open.
    Unlabelled(&'a LeftOut),
    /// This image is left out: the other camera has none that belongs to it.
    Alone(&'a Path),
}

/// Looks for the target in images, and adds them to `hash`. Without a hint it looks twice:
/// the second time with the lens that the first look gives. `tell` is called with each event, and may end the work.
///
/// # Errors
/// [`InputError`] where images cannot be read or none shows the target; those of `tell`.
pub fn views_in_images<E: From<InputError>>(
    files: &[PathBuf],
    sought: Sought<'_>,
    hash: &mut InputHash,
    tell: &mut impl FnMut(ViewEvent<'_>) -> Result<(), E>,
) -> Result<TargetImages, E> {
    for file in files.iter().map(PathBuf::as_path).chain(sought.mask.and_then(CameraMask::file)) {
        hash.add(file).map_err(InputError::from)?;
    }
    tell(ViewEvent::Looking(files.len()))?;
    let mut targets = detect_in(files, &sought)?;
    if sought.hint.is_none() {
        // Where the views give no lens, the calibration that follows says why.
        if let Ok(rough) = calibrate_intrinsics(&targets.found(), targets.size, &IntrinsicsOptions::central()) {
            targets = targets.again(files, &Sought { hint: Some(&rough.camera), ..sought })?;
        }
    }
    tell(ViewEvent::Looked)?;
    for missed in targets.missed() {
        tell(ViewEvent::Missed(missed))?;
    }
    if targets.found().is_empty() {
        let first = targets.missed().next().map(ToString::to_string).unwrap_or_default();
        return Err(InputError::NoTarget { images: files.len(), first }.into());
    }
    Ok(targets)
}

/// Image files of a pair, left and right, in the same order.
pub struct PairImages([Vec<PathBuf>; 2]);

/// The two lenses of a pair, at least roughly: left, right.
pub type PairLenses<'a> = [&'a KannalaBrandt; 2];

/// What is left out of the images of the left and of the right camera.
pub type PairMasks<'a> = [Option<&'a CameraMask>; 2];

/// Views of a pair.
#[derive(Default)]
pub struct PairViews {
    /// The views in which both cameras see the target, under labels that agree.
    pub views: Vec<StereoView>,
    /// The views left out although both cameras see the target.
    pub left_out: Vec<LeftOut>,
    /// All images of the left and of the right camera, reduced for a report.
    pub images: [Vec<ReportImage>; 2],
}

impl PairImages {
    /// The images that the patterns of the left and the right camera name, paired; `tell` hears of those without a partner.
    ///
    /// # Errors
    /// [`InputError`] where images are missing or do not pair up; those of `tell`.
    pub fn named<E: From<InputError>>(
        [left, right]: [&[String]; 2],
        tell: &mut impl FnMut(ViewEvent<'_>) -> Result<(), E>,
    ) -> Result<Self, E> {
        let PairedFiles { pairs, alone } =
            paired(&named_images(left)?, &named_images(right)?).map_err(InputError::from)?;
        for file in &alone {
            tell(ViewEvent::Alone(file))?;
        }
        Ok(Self(pairs.into_iter().map(|[left, right]| (left, right)).unzip().into()))
    }

    /// The pairs in which both images show the target, and all images.
    ///
    /// # Errors
    /// As [`views_in_images`]; images that are not of the lenses' sizes.
    pub fn views<E: From<InputError>>(
        &self,
        target: &TargetKind,
        (lenses, masks): (PairLenses<'_>, PairMasks<'_>),
        hash: &mut InputHash,
        tell: &mut impl FnMut(ViewEvent<'_>) -> Result<(), E>,
    ) -> Result<PairViews, E> {
        let [left_files, right_files] = &self.0;
        let [left_lens, right_lens] = lenses;
        let sought = |lens, mask| Sought { target, hint: Some(lens), placed: false, mask };
        let left = views_in_images(left_files, sought(left_lens, masks[0]), hash, tell)?;
        let right = views_in_images(right_files, sought(right_lens, masks[1]), hash, tell)?;
        for (side, images, lens) in [(Side::Left, left.size, left_lens), (Side::Right, right.size, right_lens)] {
            if images != lens.size() {
                return Err(InputError::OtherSize { side, images, camera: lens.size() }.into());
            }
        }
        let both = left.views.iter().zip(&right.views);
        let seen: Vec<[&SeenTarget; 2]> =
            both.filter_map(|(left, right)| left.as_ref().ok().zip(right.as_ref().ok())).map(Into::into).collect();
        let mut found = PairViews::default();
        for ([left, _], labelled) in seen.iter().zip(label_pairs(lenses, &seen)) {
            match labelled {
                Ok(view) => found.views.push(view),
                Err(reason) => {
                    let left_out = LeftOut { view: left.view.name.clone(), reason: reason.to_string() };
                    tell(ViewEvent::Unlabelled(&left_out))?;
                    found.left_out.push(left_out);
                }
            }
        }
        Ok(PairViews { images: [left.images, right.images], ..found })
    }
}

fn stereo_view(left: TargetView, right: TargetView) -> StereoView {
    StereoView { name: left.name.clone(), left, right }
}

/// Reads the pairs of a CSV file, by frame number: the frames in which both `cameras` have corners. Without names, the cameras
/// are called left and right.
///
/// # Errors
/// [`InputError`] where the file cannot be used; other than two cameras.
pub fn pairs_in_corners(
    path: &Path,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<(i64, StereoView)>, InputError> {
    let (left, right) = match cameras {
        [] => ("left", "right"),
        [left, right] => (left.as_str(), right.as_str()),
        _ => return Err(InputError::TwoCameras),
    };
    hash.add(path)?;
    let right: Vec<FrameView> = read_corners(path, Some(right))?;
    let pair = |left: FrameView| {
        let right = right.iter().find(|right| right.frame == left.frame)?;
        Some((left.frame, stereo_view(left.view, right.view.clone())))
    };
    Ok(read_corners(path, Some(left))?.into_iter().filter_map(pair).collect())
}

/// Reads the views of one camera from a CSV file; without a name, of its only camera.
///
/// # Errors
/// [`InputError`] where the file cannot be used.
pub fn views_in_corners(
    path: &Path,
    camera: Option<&str>,
    hash: &mut InputHash,
) -> Result<Vec<TargetView>, InputError> {
    hash.add(path)?;
    Ok(read_corners(path, camera)?.into_iter().map(|frame| frame.view).collect())
}
