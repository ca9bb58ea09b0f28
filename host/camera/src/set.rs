//! Images taken with two cameras at the same time.
//!
//! Both drivers stamp alike, so the difference of two stamps is more exact than either stamp: images are paired by it.

use std::collections::VecDeque;

use vergence_rig::{ImagePairing, PairingOutcome, StampedImage, TimedEvent};

use crate::{Camera, CameraError, CameraImage};

/// Number of images without a partner after which the cameras are out of step.
const MOST_ALONE: usize = 300;

/// One camera, or two whose images are taken together: paired by time where both stamp their images, in turn otherwise.
pub struct CameraSet {
    cameras: Vec<Box<dyn Camera>>,
    pairing: Option<ImagePairing>,
    waiting: [VecDeque<(u32, CameraImage)>; 2],
    alone: u64,
}

impl CameraSet {
    /// The set of `cameras`, left before right.
    #[must_use]
    pub fn new(cameras: Vec<Box<dyn Camera>>) -> Self {
        let periods = cameras.iter().map(|camera| camera.timing().map(|timing| timing.period));
        let slowest = periods.collect::<Option<Vec<_>>>().and_then(|periods| periods.into_iter().max());
        let pairing = slowest.filter(|_| cameras.len() == 2).map(ImagePairing::free_running);
        Self { cameras, pairing, waiting: Default::default(), alone: 0 }
    }

    /// Number of images without a partner so far.
    #[must_use]
    pub const fn alone(&self) -> u64 {
        self.alone
    }

    /// Number of images of all cameras that were lost before they arrived here.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.cameras.iter().map(|camera| camera.missed()).sum()
    }

    /// Takes one image with each camera, exposed at the same time.
    ///
    /// # Errors
    /// Those of the cameras; [`CameraError::Ended`] where one has no more images, [`CameraError::OutOfStep`] where two
    /// never expose at the same time.
    pub fn grab(&mut self) -> Result<Vec<CameraImage>, CameraError> {
        let Self { cameras, pairing, waiting, alone } = self;
        let mut one_of_each = || cameras.iter_mut().map(|camera| grab(camera.as_mut())).collect::<Result<Vec<_>, _>>();
        let Some(pairing) = pairing else { return one_of_each() };
        for _ in 0..MOST_ALONE {
            for (side, image) in one_of_each()?.into_iter().enumerate() {
                let (Some(seq), Some(middle)) = (image.seq, image.exposed_at) else { continue };
                waiting[side].push_back((seq, image));
                match side {
                    0 => pairing.event(TimedEvent::of_left_image(seq, middle)),
                    _ => pairing.image(StampedImage::of_right_image(seq, middle)),
                }
            }
            let mut newest = None;
            while let Some(fate) = pairing.take() {
                match fate {
                    PairingOutcome::Paired { event: left, image: right } => {
                        *alone += u64::from(newest.is_some());
                        newest = Some((take(&mut waiting[0], left), take(&mut waiting[1], right)));
                    }
                    PairingOutcome::EventAlone(left) => *alone += u64::from(take(&mut waiting[0], left).is_some()),
                    PairingOutcome::ImageAlone(right) | PairingOutcome::Ambiguous(right) => {
                        *alone += u64::from(take(&mut waiting[1], right).is_some());
                    }
                }
            }
            if let Some((Some(left), Some(right))) = newest {
                return Ok(vec![left, right]);
            }
            pairing.settle(waiting[0].back().map_or(0.0, |(_, image)| settled_before(image)));
        }
        Err(CameraError::OutOfStep { images: MOST_ALONE })
    }
}

fn grab(camera: &mut dyn Camera) -> Result<CameraImage, CameraError> {
    camera.grab()?.ok_or(CameraError::Ended)
}

/// Host time in microseconds before which every image has found its partner when `image` arrives: one second.
fn settled_before(image: &CameraImage) -> f64 {
    image.exposed_at.map_or(0.0, |at| at.us - 1e6)
}

/// Removes the image numbered `seq` and those before it; returns the former.
fn take(waiting: &mut VecDeque<(u32, CameraImage)>, seq: u32) -> Option<CameraImage> {
    let index = waiting.iter().position(|(number, _)| *number == seq)?;
    waiting.drain(..index);
    waiting.pop_front().map(|(_, image)| image)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use vergence_rig::{ExposureTiming, HostInstant};

    use super::*;

    const PERIOD: Duration = Duration::from_millis(40);

    /// Takes images at 25 Hz from number `next` on, exposed `late` after the grid; those in `lost` never arrive.
    struct Ticking {
        next: u32,
        late: Duration,
        lost: &'static [u32],
        missed: u64,
    }

    impl Camera for Ticking {
        fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
            while self.lost.contains(&self.next) {
                self.next += 1;
                self.missed += 1;
            }
            let seq = self.next;
            self.next += 1;
            let us = (PERIOD * seq + self.late).as_secs_f64() * 1e6;
            let exposed_at = Some(HostInstant { us, error_us: 20_000.0 });
            let image = image::RgbImage::new(1, 1);
            Ok(Some(CameraImage { image, name: seq.to_string(), seq: Some(seq), exposed_at, bytes: None }))
        }

        fn timing(&self) -> Option<ExposureTiming> {
            Some(ExposureTiming { period: PERIOD, exposure: None, rolling: Duration::ZERO, readout: PERIOD })
        }

        fn missed(&self) -> u64 {
            self.missed
        }
    }

    fn ticking(late_ms: u64, lost: &'static [u32]) -> Box<dyn Camera> {
        Box::new(Ticking { next: 0, late: Duration::from_millis(late_ms), lost, missed: 0 })
    }

    #[test]
    fn lost_images_do_not_shift_the_others() {
        let mut set = CameraSet::new(vec![ticking(0, &[3, 7, 8]), ticking(9, &[1, 2, 8, 9])]);
        let mut seen = Vec::new();
        while seen.last().is_none_or(|&last| last < 20) {
            let names: Vec<_> = set.grab().expect("they run").into_iter().map(|image| image.name).collect();
            assert_eq!(names[0], names[1]);
            seen.push(names[0].parse::<u32>().expect("a number"));
        }
        assert!(!seen.contains(&3) && !seen.contains(&1) && seen.contains(&4), "{seen:?}");
        assert!(set.alone() > 0);
        assert_eq!(set.missed(), 7);
    }

    /// An image halfway between two others fits both.
    #[test]
    fn cameras_out_of_step_are_an_error() {
        let mut set = CameraSet::new(vec![ticking(0, &[]), ticking(20, &[])]);
        assert!(matches!(set.grab(), Err(CameraError::OutOfStep { images: MOST_ALONE })));
    }
}
