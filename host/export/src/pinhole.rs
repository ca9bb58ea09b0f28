//! Pinhole views of a recording, as a ROS 2 bag.

use std::path::PathBuf;

use vergence_recording::{Eye, Seen, ViewsBag};
use vergence_rig::Rig;
use vergence_vision::Face;

use crate::recorded::{Sink, Taken};
use crate::views::{CameraView, describe, remarks, views};
use crate::{ExportError, Options};

/// A bag of views that is being written.
pub struct PinholeBag {
    bag: ViewsBag,
    views: Vec<CameraView>,
    remarks: Vec<String>,
    folder: PathBuf,
}

impl PinholeBag {
    /// Begins a bag of views by the cameras of `rig`, whose file is `text`; `simulated` says what of it is simulated.
    pub fn create((rig, text): (&Rig, &str), simulated: Option<&str>, options: &Options) -> Result<Self, ExportError> {
        let views = views(rig, &faces(options), options)?;
        let bag = ViewsBag::create(&options.out, text, simulated)?;
        Ok(Self { bag, views, remarks: remarks(rig), folder: options.out.clone() })
    }
}

/// The faces that the options name, each once, or all.
pub fn faces(options: &Options) -> Vec<Face> {
    let is_named = |face: &Face| options.faces.is_empty() || options.faces.contains(face);
    Face::ALL.into_iter().filter(is_named).collect()
}

impl Sink for PinholeBag {
    fn take(&mut self, taken: &Taken) -> Result<(), ExportError> {
        let placed = self.views.iter().map(|view| (Eye::from(view.side), view.face, &view.view));
        if let Some(first) = taken.images.iter().flatten().next() {
            self.bag.place(first.ns, taken.pose.as_ref(), placed)?;
        }
        for view in &self.views {
            let Some(stamped) = &taken.images[view.side.index()] else { continue };
            let image = view.of(&stamped.image);
            let eye = Eye::from(view.side);
            self.bag.write(&Seen { stamp_ns: stamped.ns, eye, face: view.face, view: &view.view, image: &image })?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<String>, ExportError> {
        self.bag.finish()?;
        describe(&self.views, &self.folder)?;
        Ok(self.remarks)
    }
}
