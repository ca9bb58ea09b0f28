//! Watches a target before cameras: whether it is seen, held still, and worth a view.

use image::imageops::grayscale;
use rayon::prelude::*;
use tokio::task::spawn_blocking;
use vergence_calibration::Coverage;
use vergence_camera::{CameraError, CameraImage};
use vergence_targets::{TargetKind, TargetView, see};
use vergence_vision::BodyMask;

use crate::InputError;
use crate::target_images::without_hidden;

/// Largest motion of a corner between two images of a target that is held still, in pixels.
const STILL_PX: f64 = 1.0;
/// Mean motion of the corners from which a target counts as held elsewhere, in pixels.
const ELSEWHERE_PX: f64 = 25.0;

/// Names of the cameras in file names.
pub const NAMES: [&str; 2] = ["left", "right"];

/// Views at one instant, one for each camera; empty where one of them does not see the target.
pub type TargetViews = Vec<TargetView>;

/// Looks for the target in the images of one instant.
fn observe(frames: &[CameraImage], target: &TargetKind) -> TargetViews {
    let view = |frame: &CameraImage| Some(see(&grayscale(&frame.image), target, None, &frame.name).ok()?.view);
    frames.par_iter().map(view).collect::<Option<_>>().unwrap_or_default()
}

/// Takes the images of one instant with `grab` and looks for the target in them, on a thread of its own: links and pages must not wait.
///
/// # Errors
/// Those of `grab`; [`InputError::Looking`] where the search was given up.
pub async fn look<C: Send + 'static>(
    mut cameras: C,
    grab: fn(&mut C) -> Result<Vec<CameraImage>, CameraError>,
    target: TargetKind,
) -> Result<(C, Vec<CameraImage>, TargetViews), InputError> {
    let looked = spawn_blocking(move || {
        let images = grab(&mut cameras)?;
        let views = observe(&images, &target);
        Ok((cameras, images, views))
    });
    looked.await.map_err(|error| InputError::Looking(error.to_string()))?
}

/// A set of views being taken: its coverage, its views, and the last observation.
pub struct TargetWatch {
    coverage: Vec<Coverage>,
    masks: Vec<Option<BodyMask>>,
    last: TargetViews,
    views: Vec<TargetViews>,
}

impl TargetWatch {
    /// An empty set with a coverage for each camera.
    #[must_use]
    pub fn new(coverage: Vec<Coverage>) -> Self {
        Self { coverage, masks: Vec::new(), last: TargetViews::new(), views: Vec::new() }
    }

    /// An empty set of one or two cameras with these first images, of which `masks` hide parts: nothing is asked for there.
    #[must_use]
    pub fn of_cameras(images: &[CameraImage], masks: [Option<BodyMask>; 2]) -> Self {
        let coverage = |(image, mask): (&CameraImage, &Option<BodyMask>)| {
            Coverage::within(image.size(), |pixel| !mask.as_ref().is_some_and(|mask| mask.hides(pixel)))
        };
        Self::new(images.iter().zip(&masks).map(coverage).collect()).masked(masks)
    }

    /// The same, for cameras of whose images `masks` hide parts: corners there do not count.
    #[must_use]
    pub fn masked(self, masks: impl Into<Vec<Option<BodyMask>>>) -> Self {
        Self { masks: masks.into(), ..self }
    }

    /// Takes the views of now; returns whether all cameras see the target held still.
    pub fn observe(&mut self, mut now: TargetViews) -> bool {
        for (view, mask) in now.iter_mut().zip(&self.masks) {
            without_hidden(view, mask.as_ref());
        }
        if now.iter().any(|view| view.corners.is_empty()) {
            now.clear();
        }
        let before = std::mem::replace(&mut self.last, now);
        !before.is_empty()
            && before.len() == self.last.len()
            && before.iter().zip(&self.last).all(|(a, b)| is_still(a, b))
    }

    /// Whether the last views add coverage.
    #[must_use]
    pub fn is_news(&self) -> bool {
        self.coverage.iter().zip(&self.last).any(|(coverage, view)| coverage.is_news(view))
    }

    /// Whether the target is held elsewhere than in every view of the set.
    #[must_use]
    pub fn is_elsewhere(&self) -> bool {
        self.views.iter().all(|taken| taken.iter().zip(&self.last).any(|(a, b)| distance(a, b) > ELSEWHERE_PX))
    }

    /// Adds the last views to the set.
    pub fn take(&mut self) {
        for (coverage, view) in self.coverage.iter_mut().zip(&self.last) {
            coverage.add(view);
        }
        self.views.push(self.last.clone());
    }

    /// What each camera's set covers.
    #[must_use]
    pub fn coverage(&self) -> &[Coverage] {
        &self.coverage
    }

    /// The views of now, one for each camera; none where one of them does not see the target.
    #[must_use]
    pub fn seen(&self) -> &[TargetView] {
        &self.last
    }

    /// The views of the set that the camera `number` has, 0 for the left one.
    pub fn views_of(&self, number: usize) -> impl Iterator<Item = &TargetView> {
        self.views.iter().filter_map(move |views| views.get(number))
    }

    /// Number of views in the set.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.views.len()
    }

    /// Whether the coverage of every camera is complete.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        !self.coverage.is_empty() && self.coverage.iter().all(|coverage| coverage.advice().is_none())
    }

    /// Advice on what to show next; `None` where nothing is missing.
    #[must_use]
    pub fn advice(&self) -> Option<String> {
        let advice = self.coverage.iter().zip(NAMES).find_map(|(coverage, name)| Some((coverage.advice()?, name)));
        advice.map(|(advice, name)| match self.coverage.len() {
            0 | 1 => advice.to_string(),
            _ => format!("{name} camera: {advice}"),
        })
    }
}

/// Whether the target did not move.
fn is_still(before: &TargetView, now: &TargetView) -> bool {
    let (mut count, mut worst) = (0, 0f64);
    for px in motion(before, now) {
        (count, worst) = (count + 1, worst.max(px));
    }
    count * 2 >= now.corners.len() && count > 0 && worst < STILL_PX
}

/// Mean motion of the corners that both views have, in pixels; infinite where they have none in common.
fn distance(before: &TargetView, now: &TargetView) -> f64 {
    let (count, sum) = motion(before, now).fold((0.0, 0.0), |(count, sum), px| (count + 1.0, sum + px));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

fn motion<'a>(before: &'a TargetView, now: &'a TargetView) -> impl Iterator<Item = f64> + 'a {
    now.corners.iter().filter_map(|corner| {
        let same = before.corners.iter().find(|other| same_place(other.target_mm, corner.target_mm))?;
        Some((corner.pixel.u - same.pixel.u).hypot(corner.pixel.v - same.pixel.v))
    })
}

fn same_place([x, y]: [f64; 2], [other_x, other_y]: [f64; 2]) -> bool {
    (x - other_x).abs() < 1e-6 && (y - other_y).abs() < 1e-6
}
