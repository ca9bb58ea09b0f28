//! Targets in image files.

use std::fmt;
use std::path::{Path, PathBuf};

use image::imageops::grayscale;
use rayon::prelude::*;
use vergence_calibration_report::ReportImage;
use vergence_camera::{CameraError, camera_mask, read_image};
use vergence_rig::CameraMask;
use vergence_targets::{DetectError, SearchedImage, SeenTarget, TargetKind, TargetView, see_from};
use vergence_vision::{BodyMask, ImageSize, KannalaBrandt};

use crate::InputError;
use crate::image_files::name_of;

/// Targets found in a set of images.
pub struct TargetImages {
    /// Size of all images.
    pub size: ImageSize,
    /// One entry for each image, in their order: the target as it is seen, or why it is not.
    pub views: Vec<Result<SeenTarget, Missed>>,
    /// Every image that can be read, reduced for a report.
    pub images: Vec<ReportImage>,
    /// What the search found in each image, in their order: who looks again does not search again.
    searched: Vec<SearchedImage>,
}

/// An image that gives no view.
#[derive(Clone, Debug)]
pub struct Missed {
    /// File name of the image.
    pub name: String,
    /// Why it gives none.
    pub reason: MissedReason,
}

/// Why an image gives no view.
#[derive(Clone, Debug)]
pub enum MissedReason {
    /// No target was found in the image.
    NoTarget(DetectError),
    /// The mask hides every corner.
    Hidden,
    /// Part of the target is seen, and it is open which part.
    Unplaced,
    /// The file is damaged.
    Damaged(String),
}

impl fmt::Display for Missed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            MissedReason::NoTarget(error) => write!(f, "{}: {error}", self.name),
            MissedReason::Unplaced => write!(
                f,
                "{}: left out: part of the target is seen and may be any part of it, but a bow is one of the whole target",
                self.name
            ),
            MissedReason::Hidden => write!(f, "{}: the mask hides the whole target", self.name),
            MissedReason::Damaged(why) => write!(f, "{}: left out: {why}", self.name),
        }
    }
}

impl TargetImages {
    /// The views in which a target was found.
    #[must_use]
    pub fn found(&self) -> Vec<TargetView> {
        self.views.iter().flatten().map(|seen| seen.view.clone()).collect()
    }

    /// Looks again at `files`, the images that these targets are from. Images in which nothing is found now keep their view.
    ///
    /// # Errors
    /// A file that cannot be opened, images of different sizes, or only damaged ones.
    pub fn again(self, files: &[PathBuf], sought: &Sought<'_>) -> Result<Self, InputError> {
        let now = look_at(files, self.searched, sought)?;
        let views = now.views.into_iter().zip(self.views).map(|(now, before)| now.or(before)).collect();
        Ok(Self { views, ..now })
    }

    /// The images without a view.
    pub fn missed(&self) -> impl Iterator<Item = &Missed> {
        self.views.iter().filter_map(|view| view.as_ref().err())
    }
}

/// What is looked for in images of one camera.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// The target.
    pub target: &'a TargetKind,
    /// A camera that is roughly right: with it more corners are found, and better.
    pub hint: Option<&'a KannalaBrandt>,
    /// Whether it counts where on the target the corners lie, as for its bow; not only how they lie to one another.
    pub placed: bool,
    /// What is left out of the images: no corner is taken there.
    pub mask: Option<&'a CameraMask>,
}

/// Looks for the target in every image. A damaged image gives no view.
///
/// # Errors
/// A file that cannot be opened, images of different sizes, or only damaged ones.
pub fn detect_in(files: &[PathBuf], sought: &Sought<'_>) -> Result<TargetImages, InputError> {
    look_at(files, vec![SearchedImage::default(); files.len()], sought)
}

/// The same, by what the search found in each of the files before.
fn look_at(files: &[PathBuf], searched: Vec<SearchedImage>, sought: &Sought<'_>) -> Result<TargetImages, InputError> {
    let looked = files.par_iter().zip(&searched).map(|(path, searched)| look(path, searched, sought));
    let looked: Vec<_> = looked.collect::<Result<_, InputError>>()?;
    let Some((width, height)) = looked.iter().find_map(|looked| looked.size) else {
        let first = looked.iter().find_map(|looked| looked.view.as_ref().err()).map(ToString::to_string);
        return Err(InputError::Damaged { images: files.len(), first });
    };
    for (path, Looked { size, .. }) in files.iter().zip(&looked) {
        if let Some(other) = size.filter(|size| *size != (width, height)) {
            return Err(InputError::wrong(
                path,
                format!(
                    "it is {} x {} and the images before are {width} x {height}: calibrate one size at a time",
                    other.0, other.1
                ),
            ));
        }
    }
    let (views, images): (Vec<_>, Vec<_>) = looked.into_iter().map(|looked| (looked.view, looked.reduced)).unzip();
    Ok(TargetImages {
        size: ImageSize { width, height },
        views,
        images: images.into_iter().flatten().collect(),
        searched,
    })
}

/// What one file gives.
struct Looked {
    /// Width and height; `None` if the file is damaged.
    size: Option<(u32, u32)>,
    view: Result<SeenTarget, Missed>,
    /// The image, reduced for a report; `None` if the file is damaged.
    reduced: Option<ReportImage>,
}

fn look(
    path: &Path,
    searched: &SearchedImage,
    Sought { target, hint, placed, mask }: &Sought<'_>,
) -> Result<Looked, InputError> {
    let name = name_of(path);
    let image = match read_image(path) {
        Ok(image) => image,
        Err(CameraError::NotAnImage { why, .. }) => {
            let view = Err(Missed { name, reason: MissedReason::Damaged(why) });
            return Ok(Looked { size: None, view, reduced: None });
        }
        Err(error) => return Err(error.into()),
    };
    let grey = grayscale(&image);
    let reduced = Some(ReportImage::new(&name, &grey));
    let (width, height) = image.dimensions();
    let mask = mask.map(|mask| camera_mask(mask, ImageSize { width, height })).transpose()?;
    let view = match see_from(searched, &grey, target, *hint, &name) {
        Ok(seen) if *placed && !seen.is_placed(target) => Err(Missed { name, reason: MissedReason::Unplaced }),
        Ok(seen) => unhidden(seen, mask.as_ref()),
        Err(error) => Err(Missed { name, reason: MissedReason::NoTarget(error) }),
    };
    Ok(Looked { size: Some(image.dimensions()), view, reduced })
}

/// Drops the corners that a mask hides.
pub(crate) fn without_hidden(view: &mut TargetView, mask: Option<&BodyMask>) {
    view.corners.retain(|corner| !mask.is_some_and(|mask| mask.hides(corner.pixel)));
}

/// The view without the corners that a mask hides; none where it hides all.
fn unhidden(mut seen: SeenTarget, mask: Option<&BodyMask>) -> Result<SeenTarget, Missed> {
    without_hidden(&mut seen.view, mask);
    if seen.view.corners.is_empty() {
        return Err(Missed { name: seen.view.name, reason: MissedReason::Hidden });
    }
    Ok(seen)
}
