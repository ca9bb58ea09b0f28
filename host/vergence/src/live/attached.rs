//! An attached camera: a thread of its own waits for its frames, and for the camera itself where it is gone.

use std::thread;
use std::time::Duration;

use tokio::sync::mpsc::{Sender, error::TrySendError};
use vergence_vision::Side;

use super::eye::{Heard, LiveFrame, News};
use crate::camera::Camera;
use crate::failure::Failure;

/// How often a camera that is gone is looked for.
const RETRY: Duration = Duration::from_secs(1);

/// Watches the camera that `open` opens, until nobody listens any more.
pub fn attach(
    side: Side,
    mut open: impl FnMut() -> Result<Box<dyn Camera>, Failure> + Send + 'static,
    listener: Sender<Heard>,
) {
    thread::spawn(move || {
        let mut told = String::new();
        while !listener.is_closed() {
            let why = match open() {
                Ok(camera) => {
                    told.clear();
                    deliver(side, camera, &listener)
                }
                Err(failure) => failure.to_string(),
            };
            if why != told && listener.blocking_send(Heard { side, news: News::Dead(why.clone()) }).is_err() {
                return;
            }
            told = why;
            thread::park_timeout(RETRY);
        }
    });
}

/// Passes frames on until the camera fails; why it did.
fn deliver(side: Side, mut camera: Box<dyn Camera>, listener: &Sender<Heard>) -> String {
    let Some(timing) = camera.timing() else { return "the camera does not stamp its frames".into() };
    if listener.blocking_send(Heard { side, news: News::There(timing) }).is_err() {
        return String::new();
    }
    loop {
        let frame = match camera.grab() {
            Ok(Some(frame)) => frame,
            Ok(None) => return "the camera ended".into(),
            Err(failure) => return failure.to_string(),
        };
        let (Some(seq), Some(middle)) = (frame.seq, frame.exposed_at) else { continue };
        let image = frame.image;
        let frame = LiveFrame { seq, middle, picture: Box::new(move || Ok(image)) };
        // A frame for which there is no room is lost, and its number tells.
        if let Err(TrySendError::Closed(_)) = listener.try_send(Heard { side, news: News::Frame(frame) }) {
            return String::new();
        }
    }
}
