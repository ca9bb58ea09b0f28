//! What the calibrations say while they look for targets in images.

use indicatif::ProgressBar;
use vergence_calibration_input::{MissedReason, ViewEvent};

use crate::console::Console;
use crate::failure::Failure;

/// Shows that images are looked at, and names those that give no view.
pub fn tell_views(console: Console) -> impl FnMut(ViewEvent<'_>) -> Result<(), Failure> {
    let mut progress: Option<ProgressBar> = None;
    move |event| {
        match event {
            ViewEvent::Looking(images) => {
                progress = Some(console.progress(&format!("looking for the target in {images} images")));
            }
            ViewEvent::Looked => _ = progress.take().map(|progress| progress.finish_and_clear()),
            ViewEvent::Missed(missed) => match missed.reason {
                MissedReason::NoTarget(_) => console.say(missed)?,
                MissedReason::Damaged(_) => console.warn(missed.to_string()),
            },
            ViewEvent::Alone(file) => {
                console.warn(format!("{}: left out: the other camera has no image of this number", file.display()));
            }
        }
        Ok(())
    }
}
