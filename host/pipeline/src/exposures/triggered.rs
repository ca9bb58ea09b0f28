//! Cameras that the board fires: images belong together where one pulse fired both.

use std::collections::BTreeMap;

use vergence_protocol::{Microseconds, TriggerMark};
use vergence_rig::{BoardInstant, ExposureTiming, HostInstant, ImagePairing, PairingOutcome, StampedImage, TimedEvent};
use vergence_vision::Side;

use super::{Ambiguity, CameraQueue, Exposed, ExposedImage, Results, SkipReason};

/// Both cameras, and the pulses whose images are not all known yet.
pub(super) struct Triggered<T> {
    period_us: f64,
    /// Pairs the images of each camera with pulses; `None` before the camera is there.
    pairings: [Option<ImagePairing>; 2],
    pulses: BTreeMap<u32, Pulse<T>>,
}

/// A pulse and its images (left, right).
struct Pulse<T> {
    at: Microseconds,
    slots: [Slot<T>; 2],
}

enum Slot<T> {
    Waiting,
    Arrived(T),
    Missed,
}

impl<T> Slot<T> {
    fn give_up(&mut self) {
        if matches!(self, Self::Waiting) {
            *self = Self::Missed;
        }
    }
}

impl<T> Triggered<T> {
    pub(super) const fn new(period_us: f64) -> Self {
        Self { period_us, pairings: [None, None], pulses: BTreeMap::new() }
    }

    /// Number of pulses whose images are not all known yet.
    pub(super) fn open(&self) -> usize {
        self.pulses.len()
    }

    /// The camera missed all pulses before now.
    pub(super) fn camera_ready(&mut self, side: Side, timing: ExposureTiming) {
        self.pairings[side.index()] = Some(ImagePairing::new(timing.after_pulse(), self.period_us));
        self.pulses.values_mut().for_each(|pulse| pulse.slots[side.index()].give_up());
    }

    /// Takes the stamp of an image; whether the image is to be kept until its pulse is known.
    pub(super) fn image(&mut self, side: Side, stamp: StampedImage, results: &mut Results<T>) -> bool {
        let Some(pairing) = &mut self.pairings[side.index()] else { return false };
        if let Some(excess_us) = pairing.excess_us(&stamp, 0.0) {
            results.ambiguity.get_or_insert(Ambiguity { side, excess_us });
        }
        pairing.image(stamp);
        true
    }

    pub(super) fn pulse(&mut self, mark: &TriggerMark, at: HostInstant) {
        self.pulses.insert(mark.seq, Pulse { at: mark.at, slots: [Slot::Waiting, Slot::Waiting] });
        for pairing in self.pairings.iter_mut().flatten() {
            pairing.event(TimedEvent { seq: mark.seq, at });
        }
    }

    pub(super) fn settle(&mut self, until_us: f64) {
        self.pairings.iter_mut().flatten().for_each(|pairing| pairing.settle(until_us));
    }

    pub(super) fn decide(&mut self, cameras: &mut [CameraQueue<T>; 2], results: &mut Results<T>) {
        for (side, camera) in cameras.iter_mut().enumerate() {
            while let Some(fate) = self.pairings[side].as_mut().and_then(ImagePairing::take) {
                self.place(side, camera, fate, results);
            }
        }
        while let Some(pulse) = self.complete_pulse(cameras) {
            finish(pulse, cameras, results);
        }
    }

    /// Puts an image into the slot of its pulse.
    fn place(&mut self, side: usize, camera: &mut CameraQueue<T>, fate: PairingOutcome, results: &mut Results<T>) {
        let (seq, reason) = match fate {
            PairingOutcome::Paired { event, image } => {
                if let (Some(pulse), Some((_, image))) = (self.pulses.get_mut(&event), camera.remove(image)) {
                    pulse.slots[side] = Slot::Arrived(image);
                }
                return;
            }
            PairingOutcome::EventAlone(event) => {
                if let Some(pulse) = self.pulses.get_mut(&event) {
                    pulse.slots[side] = Slot::Missed;
                }
                return;
            }
            PairingOutcome::ImageAlone(image) => (image, SkipReason::ImageWithoutPulse),
            PairingOutcome::Ambiguous(image) => (image, SkipReason::ImageOfEitherPulse),
        };
        if camera.remove(seq).is_some() {
            results.skip(reason);
        }
    }

    /// The oldest pulse, once nothing more of it can arrive.
    fn complete_pulse(&mut self, cameras: &[CameraQueue<T>; 2]) -> Option<Pulse<T>> {
        let oldest = self.pulses.first_entry()?;
        let mut sides = oldest.get().slots.iter().zip(cameras);
        let waits = sides.any(|(slot, camera)| matches!(slot, Slot::Waiting) && camera.gone.is_none());
        (!waits).then(|| oldest.remove())
    }
}

/// Hands out the images of a pulse, or counts why not.
fn finish<T>(pulse: Pulse<T>, cameras: &[CameraQueue<T>; 2], results: &mut Results<T>) {
    let Pulse { at, slots } = pulse;
    let exposed = |side: Side, image| {
        let timing = cameras[side.index()].timing?;
        Some(ExposedImage { image, middle: after_pulse(at, &timing) })
    };
    let (side, image) = match slots {
        [Slot::Arrived(left), Slot::Arrived(right)] => {
            if let (Some(left), Some(right)) = (exposed(Side::Left, left), exposed(Side::Right, right)) {
                results.ready.push_back(Exposed::Pair(Box::new([left, right])));
            }
            return;
        }
        [Slot::Arrived(image), _] => (Side::Left, exposed(Side::Left, image)),
        [_, Slot::Arrived(image)] => (Side::Right, exposed(Side::Right, image)),
        _ => return results.skip(SkipReason::NoImageOfPulse),
    };
    // One image alone is worth something only where the other camera is gone.
    match (cameras[side.other().index()].gone.clone(), image) {
        (Some(why), Some(image)) => results.ready.push_back(Exposed::One { side, image: Box::new(image), why }),
        _ => results.skip(SkipReason::partner_lost(side)),
    }
}

/// The middle of the exposure that a pulse starts. The edge of the pulse is known exactly.
fn after_pulse(at: Microseconds, timing: &ExposureTiming) -> BoardInstant {
    let delay = timing.after_pulse();
    let half = 0.5 * (delay.most_us - delay.least_us);
    BoardInstant { us: at.0 as f64 + delay.least_us + half, error_us: half }
}
