//! The page that shows how target views are taken: `vergence capture --panel`, and `vergence calibrate stage --live --panel`.

use vergence_calibration_input::{LiveEvent, Looked};
use vergence_panel::{CapturePose, CaptureProgress, Panel, Serving};

use crate::console::Console;
use crate::failure::Failure;

/// A page that is served while target views are taken.
pub struct CapturePanel {
    panel: Panel,
    progress: CaptureProgress,
    /// Serves until it is dropped.
    _serving: Serving,
}

impl CapturePanel {
    pub fn new((panel, serving): (Panel, Serving)) -> Self {
        Self { panel, progress: CaptureProgress::default(), _serving: serving }
    }

    /// Shows what was seen of a set that ends after `wanted` views.
    pub fn show(&mut self, looked: &Looked<'_>, wanted: usize) {
        let images = self.progress.take(looked, wanted);
        self.panel.show_capture(&self.progress, images);
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
            LiveEvent::Looked(looked, wanted) => self.show(looked, *wanted),
            LiveEvent::Complete(sentence) => self.panel.note(sentence),
            LiveEvent::Advice(_) => {}
        }
    }

    /// Shows what the calibration is worth, and serves on until `interruption`.
    pub async fn conclude(
        mut self,
        verdicts: Vec<String>,
        interruption: impl Future<Output = ()>,
        console: Console,
    ) -> Result<(), Failure> {
        self.progress.verdicts = verdicts;
        // The images stay as they are.
        self.panel.show_capture(&self.progress, [None, None]);
        console.say("the page goes on showing this; Ctrl-C ends it")?;
        interruption.await;
        Ok(())
    }
}
