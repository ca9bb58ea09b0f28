//! The cameras that the kernel lists: what they can do, and whether this user may use them.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_board::{Finding, forbidden};
use vergence_camera::{ListedCamera, describe_camera, video_devices};

/// The folder of device files.
const DEVICES: &str = "/dev";

/// A device file of the kernel's, and what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraEntry {
    /// It was not opened.
    Unopened(PathBuf),
    /// A camera.
    Camera(Box<ListedCamera>),
    /// It cannot be opened or asked, and why.
    Closed(PathBuf, String),
}

/// The cameras of this machine; `asks` opens each of them.
#[must_use]
pub fn list_cameras(asks: bool) -> Vec<CameraEntry> {
    let describe = |device: PathBuf| match asks.then(|| describe_camera(&device)) {
        None => Some(CameraEntry::Unopened(device)),
        Some(Ok(camera)) => camera.map(|camera| CameraEntry::Camera(Box::new(camera))),
        Some(Err(error)) => Some(CameraEntry::Closed(device, error.to_string())),
    };
    video_devices(Path::new(DEVICES)).into_iter().filter_map(describe).collect()
}

impl CameraEntry {
    /// Lines for people.
    #[must_use]
    pub fn in_words(&self) -> Vec<String> {
        match self {
            Self::Unopened(device) => vec![device.display().to_string()],
            Self::Camera(camera) => camera.in_words(),
            Self::Closed(device, why) => {
                vec![format!("{}  cannot be opened: {why}; see 'vergence doctor'", device.display())]
            }
        }
    }

    /// For programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let camera = match self {
            Self::Unopened(device) => return json!({ "device": device }),
            Self::Closed(device, why) => return json!({ "device": device, "why": why }),
            Self::Camera(camera) => camera,
        };
        let formats = camera
            .formats
            .iter()
            .map(|format| json!({ "code": format.code, "understood": format.is_understood, "sizes": format.sizes }));
        let controls = camera.trigger.iter().map(|(name, value)| json!({ "control": name, "value": value }));
        json!({
            "device": camera.device, "card": camera.card, "driver": camera.driver, "place": camera.place,
            "usb": camera.usb.map(|usb| json!({ "bus": usb.bus, "mbit_per_s": usb.mbit_per_s })),
            "formats": formats.collect::<Vec<_>>(),
            "trigger": if camera.trigger.is_empty() { "cannot be told" } else { "control" },
            "trigger_controls": controls.collect::<Vec<_>>(),
        })
    }
}

/// Checks that this user may use the cameras that the kernel lists.
#[must_use]
pub fn check_cameras() -> Vec<Finding> {
    let cameras = video_devices(Path::new(DEVICES));
    if cameras.is_empty() {
        let remedy = "connect the cameras; simulated ones need none";
        return vec![Finding::warn("cameras", "there is no /dev/video device", remedy)];
    }
    let check = |path: &PathBuf| match forbidden(path) {
        Some(remedy) => Finding::forbidden("cameras", format!("you may not use {}", path.display()), remedy),
        None => Finding::pass("cameras", format!("{} may be used", path.display())),
    };
    cameras.iter().map(check).collect()
}
