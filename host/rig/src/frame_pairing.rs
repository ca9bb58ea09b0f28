//! Which frame of a camera belongs to which event: a pulse of the trigger, or a frame of the other camera.
//!
//! An event is known by its number and its instant. A frame carries the middle of its exposure as its driver tells it, later
//! than its event by a delay that varies within limits. Frames and events are both lost at times, and each arrives when it
//! likes, so that counting does not pair them. Time does, as long as all that is uncertain about it is less than the time
//! between two events. Where it is more, a frame may belong to an event that nobody heard of: that is said, not guessed.

use std::collections::VecDeque;

use crate::clock::HostInstant;

/// A pulse of the trigger, or a frame of the other camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEvent {
    /// Grows by one for each event, lost ones included.
    pub seq: u32,
    /// When it was.
    pub at: HostInstant,
}

/// A frame as its driver stamped it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedFrame {
    /// The driver's number; it grows by one for each frame that the camera took, lost ones included.
    pub seq: u32,
    /// The middle of its exposure; here `error_us` is a bound.
    pub middle: HostInstant,
}

/// How long after its event the middle of a frame's exposure lies, in microseconds; negative is before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureDelay {
    /// At least.
    pub least_us: f64,
    /// At most.
    pub most_us: f64,
}

/// What became of a frame or an event, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// They belong together.
    Paired {
        /// The event.
        event: u32,
        /// The frame.
        frame: u32,
    },
    /// The frame belongs to no event: what told of it was lost, or something else exposed the camera.
    FrameAlone(u32),
    /// The event has no frame: the camera missed it, or the frame was lost.
    EventAlone(u32),
    /// The frame fits more than one event, heard of or not.
    Ambiguous(u32),
}

/// Pairs the frames of one camera with events as both arrive, each in the order of its numbers.
#[derive(Clone, Debug)]
pub struct FramePairing {
    delay: ExposureDelay,
    period_us: f64,
    events: VecDeque<TimedEvent>,
    frames: VecDeque<StampedFrame>,
    fates: VecDeque<Fate>,
    last_event: Option<u32>,
}

impl FramePairing {
    /// Frames `delay` after their events. No two events are nearer than `period_us`, and all lie on its grid; infinite
    /// where they come one by one, and the caller waits for each.
    #[must_use]
    pub const fn new(delay: ExposureDelay, period_us: f64) -> Self {
        Self {
            delay,
            period_us,
            events: VecDeque::new(),
            frames: VecDeque::new(),
            fates: VecDeque::new(),
            last_event: None,
        }
    }

    /// An event arrived. One whose number is not higher than the last begins anew.
    pub fn event(&mut self, event: TimedEvent) {
        if self.last_event.replace(event.seq).is_some_and(|last| event.seq <= last) {
            self.give_up_events(usize::MAX);
        }
        self.events.push_back(event);
        self.resolve();
    }

    /// A frame arrived.
    pub fn frame(&mut self, frame: StampedFrame) {
        self.frames.push_back(frame);
        self.resolve();
    }

    /// Nothing of what happened before `until_us` on the host's clock will arrive any more.
    pub fn settle(&mut self, until_us: f64) {
        while let Some(frame) = self.frames.front()
            && self.latest_event(frame) < until_us
        {
            self.fates.push_back(Fate::FrameAlone(frame.seq));
            self.frames.pop_front();
        }
        let over = |event: &TimedEvent| event.at.us + event.at.error_us + self.delay.most_us < until_us;
        let overdue = self.events.iter().take_while(|event| over(event)).count();
        self.give_up_events(overdue);
    }

    /// The next thing that is certain, in the order in which it became so.
    pub fn take(&mut self) -> Option<Fate> {
        self.fates.pop_front()
    }

    /// How much longer than the time between two events the uncertainty of `frame`'s event is, in microseconds; `None`
    /// where it is shorter, and frames can be told apart.
    #[must_use]
    pub fn excess_us(&self, frame: &StampedFrame, event_error_us: f64) -> Option<f64> {
        let width = self.latest_event(frame) - self.earliest_event(frame) + 2.0 * event_error_us;
        (width >= self.period_us).then_some(width - self.period_us)
    }

    fn earliest_event(&self, frame: &StampedFrame) -> f64 {
        frame.middle.us - frame.middle.error_us - self.delay.most_us
    }

    fn latest_event(&self, frame: &StampedFrame) -> f64 {
        frame.middle.us + frame.middle.error_us - self.delay.least_us
    }

    fn resolve(&mut self) {
        // Every frame that fits an event is decided; the others wait for theirs.
        let waiting = std::mem::take(&mut self.frames);
        for frame in waiting {
            let fits = |event: &TimedEvent| self.places_on_grid(&frame, event) > 0 && self.includes(&frame, event);
            let Some(index) = self.events.iter().position(fits) else {
                self.frames.push_back(frame);
                continue;
            };
            let others = self.events.iter().skip(index + 1).any(fits);
            let certain = self.events.get(index).filter(|event| !others && self.places_on_grid(&frame, event) == 1);
            let Some(&TimedEvent { seq, .. }) = certain else {
                self.fates.push_back(Fate::Ambiguous(frame.seq));
                continue;
            };
            // Frames come in order: what was before has none.
            self.give_up_events(index);
            self.events.pop_front();
            self.fates.push_back(Fate::Paired { event: seq, frame: frame.seq });
        }
    }

    /// Whether `event` may be that of `frame`.
    fn includes(&self, frame: &StampedFrame, event: &TimedEvent) -> bool {
        let HostInstant { us, error_us } = event.at;
        us + error_us >= self.earliest_event(frame) && us - error_us <= self.latest_event(frame)
    }

    /// At how many places on the grid of events, one of which is `event`, the frame's own may be.
    fn places_on_grid(&self, frame: &StampedFrame, event: &TimedEvent) -> u64 {
        let HostInstant { us, error_us } = event.at;
        let from = self.earliest_event(frame) - error_us - us;
        let to = self.latest_event(frame) + error_us - us;
        if !self.period_us.is_finite() {
            return u64::from(from <= 0.0 && to >= 0.0);
        }
        // The casts saturate.
        ((to / self.period_us).floor() - (from / self.period_us).ceil() + 1.0) as u64
    }

    /// The first `count` events have no frame.
    fn give_up_events(&mut self, count: usize) {
        let count = count.min(self.events.len());
        self.fates.extend(self.events.drain(..count).map(|event| Fate::EventAlone(event.seq)));
    }
}
