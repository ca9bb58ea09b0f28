//! A calibration while it is taken: what the views cover, what is missing, and the verdict.

use serde::Serialize;
use serde_json::json;

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
    /// A sentence for each camera at the end; none before.
    pub verdicts: Vec<String>,
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

/// The message that shows it.
pub fn capture_message(progress: &CaptureProgress) -> Outgoing {
    let mut message = json!(progress);
    message["kind"] = json!("capture");
    text_message(&message)
}
