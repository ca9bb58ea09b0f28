//! A calibration while it is taken, alone or by a rig that drives itself: what the views cover, what is missing, and the verdict.

use std::sync::Arc;

use image::RgbImage;
use serde::Serialize;
use serde_json::json;
use vergence_calibration::Coverage;
use vergence_calibration_input::{LiveEvent, Looked};
use vergence_camera::CameraImage;

use crate::hub::text_message;
use crate::panel::Panel;
use crate::server::Serving;
use crate::streams::{Outgoing, Stream};

/// How far a set of target views has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CaptureProgress {
    /// Views in the set.
    pub views: usize,
    /// Views that end it, complete or not.
    pub wanted: usize,
    /// What to show next; `None` where nothing is missing.
    pub advice: Option<String>,
    /// Whether the target is held still.
    pub is_still: bool,
    /// What each camera sees and has, left before right.
    pub cameras: Vec<CaptureCamera>,
    /// The stage poses of a rig that drives itself, up to the present one; none of cameras alone.
    pub poses: Vec<CapturePose>,
    /// Sentences on the calibration at the end; none before.
    pub verdicts: Vec<String>,
}

/// How far the views of a stage pose have come.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CapturePose {
    /// Which it is, in words.
    pub name: String,
    /// Its views.
    pub views: usize,
}

/// What one camera sees and has of a target.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CaptureCamera {
    /// Width and height of its images in pixels.
    pub size: [u32; 2],
    /// How far the cells of its image are covered, by rows from the upper left: 1 where no view is missing; `None` where no target can be shown.
    pub cells: [[Option<f64>; 3]; 3],
    /// The corners that it sees now, in pixels.
    pub corners: Vec<[f64; 2]>,
}

impl CaptureProgress {
    /// Takes what was seen of a set that ends after `wanted` views; returns the images, left before right.
    fn take(&mut self, looked: &Looked<'_>, wanted: usize) -> [Option<Arc<RgbImage>>; 2] {
        let camera = |(number, image): (usize, &CameraImage)| CaptureCamera {
            size: image.image.dimensions().into(),
            cells: looked.watch.coverage().get(number).map(Coverage::cells).unwrap_or_default(),
            corners: looked.watch.seen().get(number).map_or_else(Vec::new, |view| {
                view.corners.iter().map(|corner| [corner.pixel.u, corner.pixel.v]).collect()
            }),
        };
        self.views = looked.watch.taken();
        self.wanted = wanted;
        self.advice = looked.watch.advice();
        self.is_still = looked.is_still;
        self.cameras = looked.images.iter().enumerate().map(camera).collect();
        if let Some(pose) = self.poses.last_mut() {
            pose.views = self.views;
        }
        [0, 1].map(|number: usize| looked.images.get(number).map(|image| Arc::new(image.image.clone())))
    }
}

/// A page that is served while target views are taken.
pub struct CapturePanel {
    panel: Panel,
    progress: CaptureProgress,
    /// Serves until it is dropped.
    _serving: Serving,
}

impl CapturePanel {
    /// Shows on `panel`, which `serving` serves, how views are taken.
    #[must_use]
    pub fn new((panel, serving): (Panel, Serving)) -> Self {
        Self { panel, progress: CaptureProgress::default(), _serving: serving }
    }

    /// Says what comes next, such as a move of the rig.
    pub fn tell(&mut self, what: &str) {
        self.progress.advice = Some(what.to_owned());
        self.show([None, None]);
    }

    /// Shows what was seen of a set that ends after `wanted` views.
    pub fn look(&mut self, looked: &Looked<'_>, wanted: usize) {
        let images = self.progress.take(looked, wanted);
        self.show(images);
        if looked.is_taken {
            self.panel.note(&format!("view {} taken", self.progress.views));
        }
    }

    /// Shows what a rig does that drives itself.
    pub fn follow(&mut self, event: &LiveEvent<'_>) {
        match event {
            LiveEvent::Begins(heading) => {
                self.progress.poses.push(CapturePose { name: (*heading).to_owned(), views: 0 });
                self.panel.note(heading);
            }
            LiveEvent::Looked(looked, wanted) => self.look(looked, *wanted),
            LiveEvent::Complete(sentence) => {
                self.panel.note(sentence);
                self.tell("this pose has its views: wait");
            }
            LiveEvent::Advice(_) => {}
        }
    }

    /// Shows what the calibration is worth, or why there is none; the images stay as they are.
    pub fn conclude(&mut self, verdicts: Vec<String>) {
        self.progress.verdicts = verdicts;
        self.show([None, None]);
    }

    fn show(&self, images: [Option<Arc<RgbImage>>; 2]) {
        self.panel.hub.put(Stream::Capture, capture_message(&self.progress));
        self.panel.hub.images.send_replace(images);
    }
}

/// The message that shows it.
fn capture_message(progress: &CaptureProgress) -> Outgoing {
    let mut message = json!(progress);
    message["kind"] = json!("capture");
    text_message(&message)
}
