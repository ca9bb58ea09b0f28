//! Checks of two photographs that are to be one pair.

use std::path::Path;

use image::RgbImage;
use vergence_camera::CameraImage;
use vergence_matching::GuidedMatcher;
use vergence_pipeline::{Method, PairCloud, PairImages, PairPose, Search, pair_cloud};
use vergence_rig::Rig;
use vergence_vision::{DropReason, Kernel};

use crate::Implausible;

/// With fewer keypoints an image has hardly any texture, and matches tell nothing of the pair.
const FEWEST_KEYPOINTS: usize = 50;
/// Least part of the keypoints that find a partner which agrees with the pose. Pairs that were taken together have 17 % to 38 %
/// (eight photographed pairs, two simulated ones), swapped or unrelated ones at most 0.2 %.
const LEAST_SHARE: f64 = 0.03;

/// Two photographs of two cameras are not the same.
///
/// # Errors
/// [`Implausible::Input`].
pub fn images_differ(left: &CameraImage, right: &CameraImage) -> Result<(), Implausible> {
    let has_texture = left.image.pixels().any(|pixel| pixel != left.image.get_pixel(0, 0));
    if left.image != right.image || !has_texture {
        return Ok(());
    }
    Err(Implausible::Input(format!(
        "the left image {} and the right image {} are the same photograph: name one of each camera",
        left.name, right.name
    )))
}

/// The names of the files do not call the left one right and the right one left.
///
/// # Errors
/// [`Implausible::Result`].
pub fn names_are_not_swapped(left: &Path, right: &Path) -> Result<(), Implausible> {
    let says = |path: &Path, word: &str| {
        path.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase().contains(word))
    };
    let only = |path: &Path, word: &str, other: &str| says(path, word) && !says(path, other);
    if !(only(left, "right", "left") && only(right, "left", "right")) {
        return Ok(());
    }
    Err(Implausible::Result(format!(
        "--left names {} and --right names {}: are they swapped?",
        left.display(),
        right.display()
    )))
}

/// How two photographs were taken, and where points are sought in them.
#[derive(Clone, Copy)]
pub struct Taken<'a> {
    /// By the cameras of this rig.
    pub rig: &'a Rig,
    /// From this pose.
    pub pose: &'a PairPose,
    /// Between these ranges, and outside of these masks.
    pub search: &'a Search,
}

/// Matches that agree with the pose, and the number of keypoints of the left image.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Agreement {
    matches: usize,
    keypoints: usize,
}

impl Agreement {
    /// Matches of `cloud` that agree with the pose: all that are neither off their epipolar plane nor behind a camera.
    fn of(cloud: &PairCloud) -> Self {
        let against = [DropReason::Epipolar, DropReason::Diverging];
        let against: usize = against.iter().filter_map(|reason| cloud.dropped.matches.get(reason)).sum();
        Self { matches: cloud.matches.saturating_sub(against), keypoints: cloud.keypoints }
    }

    /// Of what the classical matcher finds in two images; `None` where they cannot be matched.
    fn found(images: PairImages<'_>, Taken { rig, pose, search }: Taken<'_>) -> Option<Self> {
        let method = Method { matcher: &GuidedMatcher::default(), kernel: Kernel::default(), search, points: None };
        pair_cloud(images, rig, pose, method, &mut |_| ()).ok().as_ref().map(Self::of)
    }

    fn says_enough(self) -> bool {
        self.keypoints < FEWEST_KEYPOINTS || self.matches as f64 >= LEAST_SHARE * self.keypoints as f64
    }
}

/// Photographs that make `cloud` show the same things from the places of the two cameras. Where hardly any keypoint of it
/// agrees with the pose, the classical matcher looks again, with the images as they are and swapped.
///
/// # Errors
/// [`Implausible::Result`].
pub fn cloud_is_of_one_pair(cloud: &PairCloud, images: [&CameraImage; 2], taken: Taken<'_>) -> Result<(), Implausible> {
    if Agreement::of(cloud).says_enough() { Ok(()) } else { images_are_one_pair(images, taken) }
}

/// Two photographs show the same things from the places of the two cameras, as far as the classical matcher tells.
///
/// # Errors
/// [`Implausible::Result`].
pub fn images_are_one_pair([left, right]: [&CameraImage; 2], taken: Taken<'_>) -> Result<(), Implausible> {
    let found = |left: &RgbImage, right: &RgbImage| Agreement::found(PairImages { left, right }, taken);
    let Some(stated) = found(&left.image, &right.image).filter(|found| !found.says_enough()) else { return Ok(()) };
    let names = format!("{} and {}", left.name, right.name);
    let of = format!("{} of {} keypoints", stated.matches, stated.keypoints);
    let swapped = found(&right.image, &left.image).filter(|found| found.keypoints >= FEWEST_KEYPOINTS);
    Err(Implausible::Result(match swapped.filter(|found| found.says_enough()) {
        Some(swapped) => format!(
            "{names}: only {of} have a partner at this pose, and {} of {} with the images the other way round: are left and right \
             swapped?",
            swapped.matches, swapped.keypoints
        ),
        None => format!(
            "{names}: only {of} have a partner at this pose: the photographs were not taken together, or the pose is wrong by degrees"
        ),
    }))
}
