//! A calibration while it is taken: what the views cover, what is missing, and the verdict.

use std::sync::Arc;

use image::RgbImage;
use serde::Serialize;
use serde_json::json;
use vergence_calibration::Coverage;
use vergence_calibration_input::Looked;
use vergence_camera::CameraImage;

use crate::hub::text_message;
use crate::streams::Outgoing;

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
    pub fn take(&mut self, looked: &Looked<'_>, wanted: usize) -> [Option<Arc<RgbImage>>; 2] {
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

/// The message that shows it.
pub fn capture_message(progress: &CaptureProgress) -> Outgoing {
    let mut message = json!(progress);
    message["kind"] = json!("capture");
    text_message(&message)
}
