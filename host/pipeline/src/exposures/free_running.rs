//! Cameras that run freely: right images are paired with left ones by their time stamps.

use std::time::Duration;

use vergence_rig::{HostInstant, ImagePairing, PairingOutcome, StampedImage, TimedEvent};
use vergence_vision::Side;

use super::{CameraQueue, Exposed, ExposedImage, Results, SkipReason, TimeBase};

/// The pairing of both cameras; `None` until the periods of both are known.
#[derive(Default)]
pub(super) struct FreeRunning {
    pairing: Option<ImagePairing>,
}

impl FreeRunning {
    /// Starts anew with the periods of both cameras.
    pub(super) fn set_periods(&mut self, periods: [Option<Duration>; 2]) {
        self.pairing = match periods {
            [Some(left), Some(right)] => Some(ImagePairing::free_running(left.max(right))),
            _ => None,
        };
    }

    /// Takes the stamp of an image; whether the image is to be kept until its partner is known.
    pub(super) fn image(&mut self, side: Side, stamp: StampedImage) -> bool {
        let Some(pairing) = &mut self.pairing else { return false };
        match side {
            Side::Left => pairing.event(TimedEvent::of_left_image(stamp.seq, stamp.middle)),
            Side::Right => pairing.image(StampedImage::of_right_image(stamp.seq, stamp.middle)),
        }
        true
    }

    pub(super) fn settle(&mut self, until_us: f64) {
        self.pairing.iter_mut().for_each(|pairing| pairing.settle(until_us));
    }

    pub(super) fn decide<T>(&mut self, cameras: &mut [CameraQueue<T>; 2], base: &TimeBase, results: &mut Results<T>) {
        while let Some(fate) = self.pairing.as_mut().and_then(ImagePairing::take) {
            let [left, right] = &mut *cameras;
            let (lone, reason) = match fate {
                PairingOutcome::Paired { event, image } => {
                    if let (Some(left), Some(right)) = (left.remove(event), right.remove(image)) {
                        pair(left, right, base, results);
                    }
                    continue;
                }
                PairingOutcome::EventAlone(event) => (left.remove(event), SkipReason::RightImageLost),
                PairingOutcome::ImageAlone(image) => (right.remove(image), SkipReason::LeftImageLost),
                PairingOutcome::Ambiguous(image) => (right.remove(image), SkipReason::OutOfStep),
            };
            if lone.is_some() {
                results.skip(reason);
            }
        }
    }
}

fn pair<T>(
    (left_at, left): (HostInstant, T),
    (right_at, right): (HostInstant, T),
    base: &TimeBase,
    results: &mut Results<T>,
) {
    match (base.instant(left_at), base.instant(right_at)) {
        (Some(left_at), Some(right_at)) => {
            let left = ExposedImage { image: left, middle: left_at };
            let right = ExposedImage { image: right, middle: right_at };
            results.ready.push_back(Exposed::Pair(Box::new([left, right])));
        }
        _ => results.skip(SkipReason::ClockUnknown),
    }
}
