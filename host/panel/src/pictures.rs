//! The images that were measured, as JPEG for the pages.

use std::sync::{Arc, Mutex, PoisonError};

use image::codecs::jpeg::JpegEncoder;
use image::{ImageError, RgbImage};
use serde_json::json;
use vergence_camera::{CameraEvent, PendingImage};
use vergence_vision::Side;

use crate::hub::{Hub, Images};
use crate::message::packed;
use crate::streams::{Outgoing, Stream};

/// Quality of the JPEG, 1 to 100.
const QUALITY: u8 = 80;

/// Keeps the image that each camera developed last.
#[derive(Clone, Default)]
pub struct Darkroom(Arc<Mutex<Images>>);

impl Darkroom {
    fn keep(&self, side: Side, image: RgbImage) {
        // A poisoned lock only means that another thread panicked; an image is replaced whole.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)[side as usize] = Some(Arc::new(image));
    }

    /// The images, and none of them a second time: a camera that is dead shows nothing.
    pub fn images(&self) -> Images {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The event, whose image is kept when it is developed.
pub fn tapped(event: CameraEvent, side: Side, darkroom: &Darkroom) -> CameraEvent {
    let CameraEvent::Image(PendingImage { seq, middle, bytes, develop }) = event else { return event };
    let darkroom = darkroom.clone();
    CameraEvent::Image(PendingImage {
        seq,
        middle,
        bytes,
        develop: Box::new(move || {
            let image = develop()?;
            darkroom.keep(side, image.clone());
            Ok(image)
        }),
    })
}

/// The message that shows an image.
fn picture_message(side: Side, image: &RgbImage) -> Result<Outgoing, ImageError> {
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(image)?;
    let (width, height) = image.dimensions();
    let header = json!({ "kind": "picture", "side": side.to_string(), "width": width, "height": height });
    Ok(packed(&header, &jpeg))
}

/// Encodes every newest pair of images and shows it. Pairs that come meanwhile are skipped.
pub async fn show_pictures(hub: Arc<Hub>) {
    let mut images = hub.images.subscribe();
    while images.changed().await.is_ok() {
        let newest = images.borrow_and_update().clone();
        for (image, (side, stream)) in
            newest.into_iter().zip([(Side::Left, Stream::Left), (Side::Right, Stream::Right)])
        {
            let Some(image) = image else { continue };
            let encoded = tokio::task::spawn_blocking(move || picture_message(side, &image)).await;
            // Images of cameras have pixels, which is all that the encoder asks for.
            if let Ok(Ok(message)) = encoded {
                hub.put(stream, message);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use vergence_camera::CameraError;
    use vergence_rig::HostInstant;

    use super::*;

    #[test]
    fn an_image_is_shown_as_the_live_loop_saw_it_and_only_once() {
        let darkroom = Darkroom::default();
        let image = RgbImage::from_pixel(8, 6, Rgb([10, 200, 30]));
        let kept = image.clone();
        let develop = Box::new(move || Ok::<_, CameraError>(image));
        let middle = HostInstant { us: 0.0, error_us: 0.0 };
        let event =
            tapped(CameraEvent::Image(PendingImage { seq: 7, middle, bytes: None, develop }), Side::Right, &darkroom);
        assert_eq!(darkroom.images(), [None, None], "nothing is developed that nobody wants");
        let CameraEvent::Image(pending) = event else { panic!("an image") };
        assert_eq!((pending.seq, (pending.develop)().expect("an image")), (7, kept.clone()));
        assert_eq!(darkroom.images(), [None, Some(Arc::new(kept.clone()))]);
        assert_eq!(darkroom.images(), [None, None]);
        let Outgoing::Binary(bytes) = picture_message(Side::Right, &kept).expect("a message") else { panic!("binary") };
        let header = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        let shown = image::load_from_memory(&bytes[4 + header..]).expect("JPEG").to_rgb8();
        assert_eq!(shown.dimensions(), (8, 6));
        assert!(shown.pixels().all(|pixel| pixel.0.iter().zip([10, 200, 30]).all(|(got, was)| got.abs_diff(was) < 8)));
    }
}
