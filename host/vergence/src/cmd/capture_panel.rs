//! `vergence capture --panel`: the page that shows how a set of target views fills.

use std::net::SocketAddr;
use std::sync::Arc;

use serde_json::json;
use tokio::task::spawn_blocking;
use vergence_calibration_input::{Captured, Looked};
use vergence_panel::{CaptureCamera, CaptureProgress, Panel, Serving, Setting};

use super::panel::{access, listen};
use crate::console::Console;
use crate::failure::Failure;

/// A page that is served while a set of target views is taken.
pub struct CapturePanel {
    panel: Panel,
    progress: CaptureProgress,
    /// Serves until it is dropped.
    _serving: Serving,
}

impl CapturePanel {
    /// Begins to serve at this address, for other computers too or not, and says where.
    pub fn serve(setting: Setting, (address, network): (SocketAddr, bool), console: Console) -> Result<Self, Failure> {
        // Nothing moves: there are no orders to be carried out.
        let (panel, _) = Panel::new(setting);
        let serving = panel.serve(listen(address)?, access(address, network)?)?;
        console.say(format!("the panel is at {}", serving.url()))?;
        console.result(&json!({ "url": serving.url() }))?;
        Ok(Self { panel, progress: CaptureProgress::default(), _serving: serving })
    }

    /// Shows what was seen of a set that ends after `wanted` views.
    pub fn show(&mut self, looked: &Looked<'_>, wanted: usize) {
        let seen = |number: usize| looked.watch.seen().get(number).map_or(&[][..], |view| &view.corners);
        let cameras = looked.watch.coverage().iter().zip(looked.images).enumerate();
        let cameras = cameras.map(|(number, (coverage, image))| CaptureCamera {
            size: image.image.dimensions().into(),
            cells: coverage.cells(),
            corners: seen(number).iter().map(|corner| [corner.pixel.u, corner.pixel.v]).collect(),
        });
        self.progress = CaptureProgress {
            views: looked.watch.taken(),
            wanted,
            advice: looked.watch.advice(),
            is_still: looked.is_still,
            cameras: cameras.collect(),
            verdicts: Vec::new(),
        };
        let image = |number: usize| looked.images.get(number).map(|image| Arc::new(image.image.clone()));
        self.panel.show_capture(&self.progress, [0, 1].map(image));
        if looked.is_taken {
            self.panel.note(&format!("view {} taken", self.progress.views));
        }
    }

    /// Calibrates each lens with the views, shows how well they do, and serves on until `interruption`.
    pub async fn conclude(
        self,
        captured: Captured,
        interruption: impl Future<Output = ()>,
        console: Console,
    ) -> Result<(), Failure> {
        self.panel.note("the views are taken: each lens is calibrated with them");
        let calibrated = spawn_blocking(move || captured.verdicts()).await;
        let verdicts = calibrated.map_err(|error| Failure::device(format!("calibrating failed: {error}")))?;
        for verdict in &verdicts {
            console.say(verdict)?;
        }
        // The images stay as they are.
        self.panel.show_capture(&CaptureProgress { verdicts, ..self.progress }, [None, None]);
        console.say("the page goes on showing this; Ctrl-C ends it")?;
        interruption.await;
        Ok(())
    }
}
