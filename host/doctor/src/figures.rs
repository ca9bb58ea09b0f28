//! From what was heard of two cameras to figures.

use std::collections::BTreeMap;

use vergence_camera::{ImageQuality, UsbLink};
use vergence_rig::{ExposureTiming, ImagePairing, PairingOutcome, SequenceWatch, StampedImage, TimedEvent};

use crate::camera_test::{Heard, HeardImage};

/// A median and a largest value, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Half of the values are below.
    pub median_ms: f64,
    /// The largest.
    pub most_ms: f64,
}

/// Figures of the images that were looked at: each is the median of theirs.
pub type ImageFigures = ImageQuality;

/// How the images of a camera follow the pulses of the trigger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerFigures {
    /// Number of pulses.
    pub pulses: usize,
    /// Pulses whose image was found by its time.
    pub paired: usize,
    /// Images that time does not tell apart: more than one pulse fits.
    pub ambiguous: usize,
    /// From the pulse to the arrival of the image in this program; `None` where no pulse has an image.
    pub arrival: Option<Step>,
    /// From the pulse to the middle of the exposure, as its stamp says.
    pub stamp: Option<Step>,
}

/// Figures of one camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraFigures {
    /// Number of images that arrived.
    pub images: usize,
    /// Images that are missing by their numbers.
    pub lost: u64,
    /// Images per second, lost ones counted; `None` with fewer than three images.
    pub rate_hz: Option<f64>,
    /// What the trigger, or else the driver, promises.
    pub expected_hz: Option<f64>,
    /// Standard deviation of the time from one image to the next, in milliseconds.
    pub jitter_ms: Option<f64>,
    /// Exposure and sharpness; `None` where no image could be looked at.
    pub looks: Option<ImageFigures>,
    /// Mean bytes of an image; `None` where they come over no cable.
    pub bytes: Option<f64>,
    /// The camera's USB bus.
    pub usb: Option<UsbLink>,
    /// Pulses and images; `None` where the camera runs freely.
    pub trigger: Option<TriggerFigures>,
    /// What went wrong.
    pub troubles: Vec<String>,
}

/// Figures of both cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TestFigures {
    /// The left and the right camera.
    pub cameras: [CameraFigures; 2],
    /// How each exposes; `None` of one that was never there.
    pub timing: [Option<ExposureTiming>; 2],
    /// Pairs that were found.
    pub pairs: usize,
    /// Images without a partner, but those at the ends.
    pub alone: usize,
    /// Difference of the stamps of both images of a pair: the sizes of it.
    pub difference: Option<Step>,
    /// Two images whose stamps differ by more are never called a pair, in milliseconds.
    pub bound_ms: Option<f64>,
    /// Whether pairs are told by the pulses of the trigger; else by the stamps alone.
    pub by_trigger: bool,
}

impl CameraFigures {
    /// Megabytes per second that the camera sends at the rate that is expected of it.
    #[must_use]
    pub fn mb_per_s(&self) -> Option<f64> {
        Some(self.bytes? * self.expected_hz.or(self.rate_hz)? * 1e-6)
    }
}

/// The figures of what was `heard` of cameras on these buses, which a trigger fired every `period_us` microseconds, or nothing did.
#[must_use]
pub fn figures(heard: &Heard, usb: [Option<UsbLink>; 2], period_us: Option<f64>) -> TestFigures {
    let mut partners: [BTreeMap<u32, u32>; 2] = Default::default();
    let mut cameras: [CameraFigures; 2] = Default::default();
    for (side, (camera, usb)) in cameras.iter_mut().zip(usb).enumerate() {
        *camera = of_camera(heard, side, period_us);
        camera.usb = usb;
        if let (Some(timing), Some(period_us)) = (heard.timing[side], period_us) {
            let pairing = ImagePairing::new(timing.after_pulse(), period_us);
            let pulses = heard.pulses.iter().map(|&(seq, at)| (at.us, TimedEvent { seq, at }));
            let outcomes = pair(pairing, pulses.collect(), &stamped(&heard.images[side]));
            camera.trigger = Some(of_trigger(heard, side, &outcomes));
            // By pulse.
            partners[side] = paired(&outcomes).collect();
        }
    }
    let (pairs, bound_us) = match period_us {
        Some(_) => {
            let both = partners[0].iter().filter_map(|(pulse, left)| Some((*left, *partners[1].get(pulse)?))).collect();
            (both, heard.timing.iter().flatten().map(after_pulse_width).reduce(f64::max))
        }
        None => free_pairs(heard),
    };
    let by_seq = |side: usize| heard.images[side].iter().map(|image| (image.seq, image.middle.us)).collect();
    let [left, right]: [BTreeMap<u32, f64>; 2] = [by_seq(0), by_seq(1)];
    let apart = pairs.iter().filter_map(|(l, r)| Some((left.get(l)? - right.get(r)?).abs() * 1e-3)).collect();
    let fewest = heard.images.iter().map(Vec::len).max().unwrap_or_default();
    TestFigures {
        cameras,
        timing: heard.timing,
        pairs: pairs.len(),
        // Each end of the listening may cut a pair.
        alone: fewest.saturating_sub(pairs.len() + 2),
        difference: step(apart),
        bound_ms: bound_us.map(|us| us * 1e-3),
        by_trigger: period_us.is_some(),
    }
}

/// By how much two exposures of one pulse may be apart, by what is known of a camera.
fn after_pulse_width(timing: &ExposureTiming) -> f64 {
    let delay = timing.after_pulse();
    delay.most_us - delay.least_us
}

/// Pairs of images of free-running cameras, and the largest difference that makes one, in microseconds.
fn free_pairs(heard: &Heard) -> (Vec<(u32, u32)>, Option<f64>) {
    let [Some(left), Some(right)] = heard.timing else { return (Vec::new(), None) };
    let period = left.period.max(right.period);
    let events =
        heard.images[0].iter().map(|image| (image.arrived_us, TimedEvent::of_left_image(image.seq, image.middle)));
    let images: Vec<_> = heard.images[1]
        .iter()
        .map(|image| (image.arrived_us, StampedImage::of_right_image(image.seq, image.middle)))
        .collect();
    let outcomes = pair(ImagePairing::free_running(period), events.collect(), &images);
    (paired(&outcomes).collect(), Some(ImagePairing::FREE_RUNNING_TOLERANCE * period.as_secs_f64() * 1e6))
}

fn stamped(images: &[HeardImage]) -> Vec<(f64, StampedImage)> {
    images.iter().map(|image| (image.arrived_us, StampedImage { seq: image.seq, middle: image.middle })).collect()
}

/// The outcomes of events and images in the order in which they came.
fn pair(
    mut pairing: ImagePairing,
    events: Vec<(f64, TimedEvent)>,
    images: &[(f64, StampedImage)],
) -> Vec<PairingOutcome> {
    let mut events = events.into_iter().peekable();
    let mut outcomes = Vec::new();
    for &(arrived, image) in images {
        while let Some((_, event)) = events.next_if(|(at, _)| *at <= arrived) {
            pairing.event(event);
        }
        pairing.image(image);
    }
    events.for_each(|(_, event)| pairing.event(event));
    pairing.settle(f64::INFINITY);
    outcomes.extend(std::iter::from_fn(|| pairing.take()));
    outcomes
}

fn paired(outcomes: &[PairingOutcome]) -> impl Iterator<Item = (u32, u32)> {
    outcomes.iter().filter_map(|outcome| match outcome {
        PairingOutcome::Paired { event, image } => Some((*event, *image)),
        _ => None,
    })
}

fn of_camera(heard: &Heard, side: usize, period_us: Option<f64>) -> CameraFigures {
    let images = &heard.images[side];
    let mut watch = SequenceWatch::default();
    let gaps: Vec<u64> = images.iter().map(|image| watch.note(image.seq)).collect();
    let steps = images.windows(2).zip(gaps.iter().skip(1));
    let one_period: Vec<f64> =
        steps.filter(|(_, gap)| **gap == 0).map(|(pair, _)| (pair[1].middle.us - pair[0].middle.us) * 1e-3).collect();
    let span_s = images.first().zip(images.last()).map(|(first, last)| (last.middle.us - first.middle.us) * 1e-6);
    let intervals = (images.len() as u64).saturating_sub(1) + watch.missed();
    let sent: Vec<f64> = images.iter().filter_map(|image| image.bytes).map(f64::from).collect();
    let driver = heard.timing[side].map(|timing| 1.0 / timing.period.as_secs_f64());
    CameraFigures {
        images: images.len(),
        lost: watch.missed(),
        rate_hz: span_s.filter(|&span| span > 0.0 && images.len() > 2).map(|span| intervals as f64 / span),
        expected_hz: period_us.map(|period| 1e6 / period).or(driver),
        jitter_ms: deviation(&one_period),
        looks: looks(&heard.looks[side]),
        bytes: (!sent.is_empty()).then(|| sent.iter().sum::<f64>() / sent.len() as f64),
        usb: None,
        trigger: None,
        troubles: heard.troubles[side].clone(),
    }
}

fn of_trigger(heard: &Heard, side: usize, outcomes: &[PairingOutcome]) -> TriggerFigures {
    let pulses: BTreeMap<u32, f64> = heard.pulses.iter().map(|(seq, at)| (*seq, at.us)).collect();
    let images: BTreeMap<u32, &HeardImage> = heard.images[side].iter().map(|image| (image.seq, image)).collect();
    let both: Vec<_> =
        paired(outcomes).filter_map(|(pulse, image)| Some((pulses.get(&pulse)?, images.get(&image)?))).collect();
    TriggerFigures {
        pulses: pulses.len(),
        paired: both.len(),
        ambiguous: outcomes.iter().filter(|outcome| matches!(outcome, PairingOutcome::Ambiguous(_))).count(),
        arrival: step(both.iter().map(|(at, image)| (image.arrived_us - **at) * 1e-3).collect()),
        stamp: step(both.iter().map(|(at, image)| (image.middle.us - **at) * 1e-3).collect()),
    }
}

fn looks(looks: &[ImageQuality]) -> Option<ImageFigures> {
    let median = |figure: fn(&ImageQuality) -> f64| Some(step(looks.iter().map(figure).collect())?.median_ms);
    Some(ImageQuality {
        mean: median(|look| look.mean)?,
        saturated: median(|look| look.saturated)?,
        black: median(|look| look.black)?,
        sharpness: median(|look| look.sharpness)?,
    })
}

/// Median and largest of `values`; `None` without any.
fn step(mut values: Vec<f64>) -> Option<Step> {
    values.sort_by(f64::total_cmp);
    Some(Step { median_ms: *values.get(values.len() / 2)?, most_ms: *values.last()? })
}

/// Standard deviation; `None` with fewer than two values.
fn deviation(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (count - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use vergence_rig::HostInstant;

    use super::*;

    const TIMING: ExposureTiming = ExposureTiming {
        period: Duration::from_millis(33),
        exposure: Some(Duration::from_millis(4)),
        rolling: Duration::ZERO,
        readout: Duration::from_millis(6),
    };

    /// Ten pulses, 100 ms apart; the left image of the third is lost, and the right camera exposes half a millisecond later.
    fn heard() -> Heard {
        let at = |us: f64| HostInstant { us, error_us: 100.0 };
        let image = |number: u32, late_us: f64| HeardImage {
            seq: number,
            middle: at(f64::from(number) * 1e5 + 2_500.0 + late_us),
            arrived_us: f64::from(number) * 1e5 + 12_000.0 + late_us,
            bytes: Some(100_000),
        };
        Heard {
            timing: [Some(TIMING); 2],
            images: [
                (0..10).filter(|number| *number != 2).map(|number| image(number, 0.0)).collect(),
                (0..10).map(|number| image(number, 500.0)).collect(),
            ],
            pulses: (0..10).map(|number| (number, at(f64::from(number) * 1e5))).collect(),
            ..Heard::default()
        }
    }

    #[test]
    fn lost_images_rates_and_delays_are_what_was_put_in() {
        let TestFigures { cameras: [left, right], pairs, difference, bound_ms, .. } =
            figures(&heard(), [None, None], Some(1e5));
        assert_eq!((left.images, left.lost, right.images, right.lost, pairs), (9, 1, 10, 0, 9));
        for camera in [&left, &right] {
            assert!((camera.rate_hz.expect("a rate") - 10.0).abs() < 1e-9, "{camera:?}");
            assert!(camera.jitter_ms.expect("jitter") < 1e-9 && (camera.mb_per_s().expect("bytes") - 1.0).abs() < 1e-9);
        }
        let trigger = |camera: &CameraFigures| camera.trigger.expect("fired");
        assert_eq!((trigger(&left).pulses, trigger(&left).paired, trigger(&right).paired), (10, 9, 10));
        assert!((trigger(&left).arrival.expect("a time").median_ms - 12.0).abs() < 1e-9);
        assert!((trigger(&right).stamp.expect("a time").median_ms - 3.0).abs() < 1e-9);
        assert!((difference.expect("pairs").most_ms - 0.5).abs() < 1e-9);
        assert!((bound_ms.expect("a bound") - 1.0).abs() < 1e-9, "by the reaction of a camera to its pulse");
    }

    #[test]
    fn cameras_that_run_freely_pair_by_their_stamps_within_half_of_a_period() {
        let timing = Some(ExposureTiming { period: Duration::from_millis(100), ..TIMING });
        let free = figures(&Heard { timing: [timing; 2], ..heard() }, [None, None], None);
        assert_eq!((free.pairs, free.by_trigger, free.cameras[0].trigger), (9, false, None));
        assert!((free.bound_ms.expect("a bound") - 49.0).abs() < 1e-9);
        assert!((free.cameras[0].expected_hz.expect("a rate") - 10.0).abs() < 1e-9);
    }
}
