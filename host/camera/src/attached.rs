//! A camera watched from a thread of its own, which waits for its images, and for the camera itself while it is gone.

use std::thread;
use std::time::Duration;

use tokio::sync::mpsc::{Sender, error::TrySendError};
use vergence_vision::Side;

use crate::{Camera, CameraError, CameraEvent, PendingImage};

/// Time between two attempts to open a camera that is gone.
const RETRY: Duration = Duration::from_secs(1);

/// Watches the camera that `open` opens, until it has no more images or the listener is closed.
///
/// The camera's events go to `listener` with `side`. An image for which the listener has no room is lost; the gap in the
/// numbers shows it.
pub fn attach(
    side: Side,
    mut open: impl FnMut() -> Result<Box<dyn Camera>, CameraError> + Send + 'static,
    listener: Sender<(Side, CameraEvent)>,
) {
    thread::spawn(move || {
        let mut reported = String::new();
        while !listener.is_closed() {
            let why = match open() {
                Ok(camera) => {
                    reported.clear();
                    match deliver(side, camera, &listener) {
                        Some(why) => why,
                        None => return,
                    }
                }
                Err(CameraError::Ended) => return,
                Err(error) => error.to_string(),
            };
            if why != reported && listener.blocking_send((side, CameraEvent::Lost(why.clone()))).is_err() {
                return;
            }
            reported = why;
            thread::park_timeout(RETRY);
        }
    });
}

/// Passes images on until the camera fails; returns why it did. `None` where it has no more images, or nobody listens.
fn deliver(side: Side, mut camera: Box<dyn Camera>, listener: &Sender<(Side, CameraEvent)>) -> Option<String> {
    let Some(timing) = camera.timing() else { return Some("the camera does not stamp its images".into()) };
    if listener.blocking_send((side, CameraEvent::Attached(timing))).is_err() {
        return None;
    }
    loop {
        let taken = match camera.grab() {
            Ok(Some(taken)) => taken,
            Ok(None) => return None,
            Err(error) => return Some(error.to_string()),
        };
        let (Some(seq), Some(middle)) = (taken.seq, taken.exposed_at) else { continue };
        let (image, bytes) = (taken.image, taken.bytes);
        let pending = PendingImage { seq, middle, bytes, develop: Box::new(move || Ok(image)) };
        if let Err(TrySendError::Closed(_)) = listener.try_send((side, CameraEvent::Image(pending))) {
            return None;
        }
    }
}
