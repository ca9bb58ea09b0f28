//! Which image of a camera belongs to which event: a pulse of the trigger, or an image of the other camera.
//!
//! An event has a number and an instant. An image carries the middle of its exposure as its driver reports it, later than
//! its event by a delay that varies within limits. Images and events are both lost at times and arrive at any time, so
//! counting cannot pair them. Their times can, as long as everything uncertain about them adds up to less than the time
//! between two events. Where it is more, an image may belong to an event that was never reported: such an image is called
//! ambiguous, and no pair is guessed.

use std::collections::VecDeque;
use std::time::Duration;

use crate::clock::HostInstant;

/// A pulse of the trigger, or an image of the other camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEvent {
    /// Number of the event: grows by one for each event, lost ones included.
    pub seq: u32,
    /// Instant of the event.
    pub at: HostInstant,
}

/// Number and time of an image, as its driver stamped it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedImage {
    /// The driver's number: grows by one for each image that the camera took, lost ones included.
    pub seq: u32,
    /// Middle of the exposure; its `error_us` is a bound.
    pub middle: HostInstant,
}

impl TimedEvent {
    /// An image of the left camera as the event that the right camera's image is paired with.
    ///
    /// Both drivers stamp alike, so the difference of two stamps is more exact than either: the error is dropped.
    #[must_use]
    pub const fn of_left_image(seq: u32, middle: HostInstant) -> Self {
        Self { seq, at: HostInstant { error_us: 0.0, ..middle } }
    }
}

impl StampedImage {
    /// An image of the right camera, to be paired with one of [`TimedEvent::of_left_image`]; its error is dropped as there.
    #[must_use]
    pub const fn of_right_image(seq: u32, middle: HostInstant) -> Self {
        Self { seq, middle: HostInstant { error_us: 0.0, ..middle } }
    }
}

/// Time from an event to the middle of its image's exposure, in microseconds; negative is before the event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureDelay {
    /// Shortest delay.
    pub least_us: f64,
    /// Longest delay.
    pub most_us: f64,
}

/// Outcome of an image or an event, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairingOutcome {
    /// Event and image belong together.
    Paired {
        /// Number of the event.
        event: u32,
        /// Number of the image.
        image: u32,
    },
    /// The image belongs to no event: its report was lost, or something else exposed the camera.
    ImageAlone(u32),
    /// The event has no image: the camera missed it, or the image was lost.
    EventAlone(u32),
    /// The image fits more than one event, reported or not.
    Ambiguous(u32),
}

/// Pairs the images of one camera with events as both arrive, each in the order of its numbers.
#[derive(Clone, Debug)]
pub struct ImagePairing {
    delay: ExposureDelay,
    period_us: f64,
    events: VecDeque<TimedEvent>,
    images: VecDeque<StampedImage>,
    fates: VecDeque<PairingOutcome>,
    last_event: Option<u32>,
}

impl ImagePairing {
    /// Images of two free-running cameras farther apart than this part of a period may belong to either of two neighbours.
    pub const FREE_RUNNING_TOLERANCE: f64 = 0.49;

    /// Pairs images that come `delay` after their events. No two events are nearer than `period_us`, and all lie on its
    /// grid; infinite where events come one by one and the caller waits for each.
    #[must_use]
    pub const fn new(delay: ExposureDelay, period_us: f64) -> Self {
        Self {
            delay,
            period_us,
            events: VecDeque::new(),
            images: VecDeque::new(),
            fates: VecDeque::new(),
            last_event: None,
        }
    }

    /// Pairs right images with left ones, of cameras that run freely and take one image each `period`.
    ///
    /// Feed it [`TimedEvent::of_left_image`] and [`StampedImage::of_right_image`].
    #[must_use]
    pub fn free_running(period: Duration) -> Self {
        let period_us = period.as_secs_f64() * 1e6;
        let within = Self::FREE_RUNNING_TOLERANCE * period_us;
        Self::new(ExposureDelay { least_us: -within, most_us: within }, period_us)
    }

    /// Takes an event that arrived. A number not higher than the last means that the source started over.
    pub fn event(&mut self, event: TimedEvent) {
        if self.last_event.replace(event.seq).is_some_and(|last| event.seq <= last) {
            self.give_up_events(usize::MAX);
        }
        self.events.push_back(event);
        self.resolve();
    }

    /// Takes an image that arrived.
    pub fn image(&mut self, image: StampedImage) {
        self.images.push_back(image);
        self.resolve();
    }

    /// Gives up what happened before `until_us` on the host's clock: nothing of it will arrive any more.
    pub fn settle(&mut self, until_us: f64) {
        while let Some(image) = self.images.front()
            && self.latest_event(image) < until_us
        {
            self.fates.push_back(PairingOutcome::ImageAlone(image.seq));
            self.images.pop_front();
        }
        let over = |event: &TimedEvent| event.at.us + event.at.error_us + self.delay.most_us < until_us;
        let overdue = self.events.iter().take_while(|event| over(event)).count();
        self.give_up_events(overdue);
    }

    /// Next outcome that is certain, in the order in which they became so.
    pub fn take(&mut self) -> Option<PairingOutcome> {
        self.fates.pop_front()
    }

    /// By how many microseconds the uncertainty of `image`'s event exceeds the time between two events; `None` where it
    /// does not, and images can be told apart.
    #[must_use]
    pub fn excess_us(&self, image: &StampedImage, event_error_us: f64) -> Option<f64> {
        let width = self.latest_event(image) - self.earliest_event(image) + 2.0 * event_error_us;
        (width >= self.period_us).then_some(width - self.period_us)
    }

    fn earliest_event(&self, image: &StampedImage) -> f64 {
        image.middle.us - image.middle.error_us - self.delay.most_us
    }

    fn latest_event(&self, image: &StampedImage) -> f64 {
        image.middle.us + image.middle.error_us - self.delay.least_us
    }

    fn resolve(&mut self) {
        // Every image that fits an event is decided; the others wait for theirs.
        let waiting = std::mem::take(&mut self.images);
        for image in waiting {
            let fits = |event: &TimedEvent| self.places_on_grid(&image, event) > 0 && self.includes(&image, event);
            let Some(index) = self.events.iter().position(fits) else {
                self.images.push_back(image);
                continue;
            };
            let others = self.events.iter().skip(index + 1).any(fits);
            let certain = self.events.get(index).filter(|event| !others && self.places_on_grid(&image, event) == 1);
            let Some(&TimedEvent { seq, .. }) = certain else {
                self.fates.push_back(PairingOutcome::Ambiguous(image.seq));
                continue;
            };
            // Images come in order: the events before this one have none.
            self.give_up_events(index);
            self.events.pop_front();
            self.fates.push_back(PairingOutcome::Paired { event: seq, image: image.seq });
        }
    }

    /// Whether `event` may be that of `image`.
    fn includes(&self, image: &StampedImage, event: &TimedEvent) -> bool {
        let HostInstant { us, error_us } = event.at;
        us + error_us >= self.earliest_event(image) && us - error_us <= self.latest_event(image)
    }

    /// Number of places on the grid of events through `event` where the event of `image` may lie.
    fn places_on_grid(&self, image: &StampedImage, event: &TimedEvent) -> u64 {
        let HostInstant { us, error_us } = event.at;
        let from = self.earliest_event(image) - error_us - us;
        let to = self.latest_event(image) + error_us - us;
        if !self.period_us.is_finite() {
            return u64::from(from <= 0.0 && to >= 0.0);
        }
        // The casts saturate.
        ((to / self.period_us).floor() - (from / self.period_us).ceil() + 1.0) as u64
    }

    /// Marks the first `count` events as having no image.
    fn give_up_events(&mut self, count: usize) {
        let count = count.min(self.events.len());
        self.fates.extend(self.events.drain(..count).map(|event| PairingOutcome::EventAlone(event.seq)));
    }
}
