//! The images that were measured, as JPEG for the pages.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use image::{Rgb, RgbImage};
use jpeg_encoder::{ColorType, Encoder, EncodingError, SamplingFactor};
use serde_json::json;
use tokio::time::{Instant, sleep};
use vergence_camera::{CameraEvent, PendingImage};
use vergence_vision::Side;

use crate::hub::{Hub, Images};
use crate::message::packed;
use crate::streams::{Outgoing, Stream};

/// Quality of the JPEG, 1 to 100.
const QUALITY: u8 = 80;
/// Larger images are halved as often as needed: no page shows more, and coding takes time from the matcher.
const WIDEST: u32 = 960;
/// After pictures that took some time to code, the coder rests so many times as long: it takes a thirtieth of one core at most.
const REST: u32 = 30;
/// The longest rest, also where the computer was too busy to code.
const LONGEST_REST: Duration = Duration::from_secs(1);

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

/// The message that shows an image. Its header has the size of the image as the camera took it, whatever the size of the picture.
fn picture_message(side: Side, image: &RgbImage) -> Result<Outgoing, EncodingError> {
    let (width, height) = image.dimensions();
    let mut halved = (width > WIDEST).then(|| half(image));
    while let Some(large) = halved.as_ref().filter(|picture| picture.width() > WIDEST) {
        halved = Some(half(large));
    }
    let picture = halved.as_ref().unwrap_or(image);
    let side_of = |pixels: u32| u16::try_from(pixels).unwrap_or(u16::MAX);
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, QUALITY);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encoder.encode(picture.as_raw(), side_of(picture.width()), side_of(picture.height()), ColorType::Rgb)?;
    let header = json!({ "kind": "picture", "side": side.to_string(), "width": width, "height": height });
    Ok(packed(&header, &jpeg))
}

/// The image at half its size; each pixel is the mean of four.
fn half(image: &RgbImage) -> RgbImage {
    let (width, row) = (image.width() / 2, 3 * image.width() as usize);
    let mut pixels = Vec::with_capacity(image.as_raw().len() / 4);
    for rows in image.as_raw().chunks_exact(2 * row) {
        let (upper, lower) = rows.split_at(row);
        for (above, below) in upper.chunks_exact(6).zip(lower.chunks_exact(6)) {
            for channel in 0..3 {
                let four = [above[channel], above[channel + 3], below[channel], below[channel + 3]];
                pixels.push(((four.map(u16::from).iter().sum::<u16>() + 2) / 4) as u8);
            }
        }
    }
    let height = image.height() / 2;
    // As many pixels as its size says.
    RgbImage::from_raw(width, height, pixels).unwrap_or_else(|| RgbImage::from_pixel(width, height, Rgb([0; 3])))
}

/// Encodes the newest pair of images while pages are open, and shows it. Pairs that come meanwhile are skipped.
pub async fn show_pictures(hub: Arc<Hub>) {
    let (mut images, mut pages) = (hub.images.subscribe(), hub.pages.subscribe());
    // The hub keeps both senders: they are not closed.
    while pages.wait_for(|count| *count > 0).await.is_ok() && images.changed().await.is_ok() {
        let newest = images.borrow_and_update().clone();
        let begun = Instant::now();
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
        sleep(begun.elapsed().saturating_mul(REST).min(LONGEST_REST)).await;
    }
}

#[cfg(test)]
mod tests {
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

    #[test]
    fn large_images_are_halved_and_small_ones_are_not() {
        let image = RgbImage::from_fn(2000, 12, |x, y| Rgb([if x % 2 == 0 { 100 } else { 50 }, (y * 4) as u8, 7]));
        let shown = half(&image);
        assert_eq!(shown.dimensions(), (1000, 6));
        assert_eq!(shown.get_pixel(999, 2), &Rgb([75, 18, 7]));
        let Ok(Outgoing::Binary(bytes)) = picture_message(Side::Left, &image) else { panic!("a message") };
        let header = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        let told: serde_json::Value = serde_json::from_slice(&bytes[4..4 + header]).expect("JSON");
        assert_eq!((&told["width"], &told["height"]), (&json!(2000), &json!(12)), "places are in pixels of the camera");
        let jpeg = image::load_from_memory(&bytes[4 + header..]).expect("JPEG");
        assert_eq!((jpeg.width(), jpeg.height()), (500, 3));
    }
}
