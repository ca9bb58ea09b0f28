//! When an image was exposed, from the driver's time stamp.

use std::time::Duration;

use crate::clock::HostInstant;
use crate::image_pairing::ExposureDelay;

/// Instant that the driver's time stamp marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampedAt {
    /// Start of the exposure.
    Start,
    /// The image was complete: exposed and read out.
    End,
}

/// Longest time from a trigger pulse to the start of the exposure: undocumented for most cameras, and sensors differ.
const REACTION: Duration = Duration::from_millis(1);

/// Timing of a camera's exposures.
///
/// ```
/// # use std::time::Duration;
/// # use vergence_rig::{ExposureTiming, StampedAt};
/// let ms = Duration::from_millis;
/// let timing = ExposureTiming { period: ms(33), exposure: Some(ms(10)), rolling: ms(0), readout: ms(20) };
/// let middle = timing.middle(ms(1000), StampedAt::Start);
/// assert_eq!((middle.at, middle.error), (ms(1005), ms(0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExposureTiming {
    /// Time from one image to the next at the full rate.
    pub period: Duration,
    /// Exposure time of one row; `None` where the camera does not report it: at most a period.
    pub exposure: Option<Duration>,
    /// Time from the start of the first row's exposure to the start of the last row's; zero for a global shutter.
    pub rolling: Duration,
    /// Longest time from the end of the last row's exposure to a stamp of [`StampedAt::End`].
    pub readout: Duration,
}

/// Middle of the exposure of an image's middle row, with the largest error it can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MiddleOfExposure {
    /// Instant, on the clock of the stamp.
    pub at: Duration,
    /// Largest error of `at`, either way.
    pub error: Duration,
}

impl MiddleOfExposure {
    /// The instant in microseconds, where the stamp was taken on the host's clock.
    #[must_use]
    pub const fn on_host(self) -> HostInstant {
        HostInstant { us: micros(self.at), error_us: micros(self.error) }
    }
}

impl ExposureTiming {
    /// Shortest and longest time from the start of the first row's exposure to the middle of the middle row's.
    fn middle_after_start(self) -> [Duration; 2] {
        let exposure = self.exposure.map_or([Duration::ZERO, self.period], |known| [known; 2]);
        exposure.map(|exposure| (exposure + self.rolling) / 2)
    }

    /// Middle of the exposure of an image that is stamped `at`.
    #[must_use]
    pub fn middle(&self, at: Duration, marks: StampedAt) -> MiddleOfExposure {
        let [least, most] = self.middle_after_start();
        let (early, late) = match marks {
            StampedAt::Start => (at + least, at + most),
            // The readout may overlap the next exposure but always follows its own.
            StampedAt::End => (at.saturating_sub(most + self.readout), at.saturating_sub(least)),
        };
        MiddleOfExposure { at: early + (late - early) / 2, error: (late - early) / 2 }
    }

    /// Time from a trigger pulse to the middle of the exposure that it starts.
    #[must_use]
    pub fn after_pulse(&self) -> ExposureDelay {
        let [least, most] = self.middle_after_start();
        ExposureDelay { least_us: micros(least), most_us: micros(most + REACTION) }
    }
}

const fn micros(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}

/// Counts the images that a driver dropped, from its sequence numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct SequenceWatch {
    last: Option<u32>,
    missed: u64,
}

impl SequenceWatch {
    /// Takes the next image's number; returns how many images were missed before it.
    pub fn note(&mut self, sequence: u32) -> u64 {
        let gap = self.last.map_or(0, |last| u64::from(sequence.wrapping_sub(last).saturating_sub(1)));
        // A driver that starts over has not missed four thousand million images.
        let gap = if gap > u64::from(u32::MAX / 2) { 0 } else { gap };
        self.last = Some(sequence);
        self.missed += gap;
        gap
    }

    /// Number of images missed so far.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stamp_is_moved_to_mid_exposure() {
        let ms = Duration::from_millis;
        let timing = ExposureTiming { period: ms(30), exposure: Some(ms(10)), rolling: ms(0), readout: ms(20) };
        let middle = |timing: ExposureTiming, marks| {
            let MiddleOfExposure { at, error } = timing.middle(ms(1000), marks);
            [at, error].map(|time| time.as_millis())
        };
        assert_eq!(middle(timing, StampedAt::Start), [1005, 0]);
        // Between 975, where reading out took the longest, and 995.
        assert_eq!(middle(timing, StampedAt::End), [985, 10]);
        let rolling = ExposureTiming { rolling: ms(8), ..timing };
        assert_eq!(middle(rolling, StampedAt::Start), [1009, 0]);
        // A camera that does not report its exposure time may expose for a whole period.
        let automatic = ExposureTiming { exposure: None, ..rolling };
        assert_eq!(middle(automatic, StampedAt::Start), [1011, 7]);
        let ExposureDelay { least_us, most_us } = rolling.after_pulse();
        assert_eq!([least_us, most_us].map(|us| us.round() as i64), [9_000, 10_000]);
    }

    #[test]
    fn gaps_are_counted_and_restarts_are_not() {
        let mut watch = SequenceWatch::default();
        let gaps: Vec<u64> = [7, 8, 11, u32::MAX, 0, 0].map(|n| watch.note(n)).into();
        assert_eq!(gaps[..3], [0, 0, 2]);
        assert_eq!(SequenceWatch { last: Some(u32::MAX), missed: 0 }.note(0), 0);
        assert_eq!(SequenceWatch { last: Some(500), missed: 0 }.note(0), 0);
    }
}
