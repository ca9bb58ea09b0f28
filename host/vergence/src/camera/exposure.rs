//! When a frame was exposed, from the kernel's time stamp.

use std::time::Duration;

use vergence_rig::ExposureDelay;

/// What the time stamp of a driver marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampedAt {
    /// Start of the exposure.
    Start,
    /// The frame was complete: exposed and read out.
    End,
}

/// How long after a pulse a camera begins to expose, at most: nobody says, and sensors differ.
const REACTION: Duration = Duration::from_millis(1);

/// How a camera takes its frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameTiming {
    /// From one frame to the next at its full rate.
    pub period: Duration,
    /// How long a row is exposed; `None` where the camera does not say: up to a period.
    pub exposure: Option<Duration>,
    /// From the exposure of the first row to that of the last; zero for a global shutter.
    pub rolling: Duration,
    /// From the end of the last row's exposure to the frame's end stamp, at most.
    pub readout: Duration,
}

/// An instant and how far it may be off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MiddleOfExposure {
    /// Of the middle row, on the clock of the stamp.
    pub at: Duration,
    /// At most so far off.
    pub error: Duration,
}

impl FrameTiming {
    /// The middle of the middle row's exposure after the first row began to be exposed: at least, and at most.
    fn middle_after_start(self) -> [Duration; 2] {
        let exposure = self.exposure.map_or([Duration::ZERO, self.period], |known| [known; 2]);
        exposure.map(|exposure| (exposure + self.rolling) / 2)
    }

    /// The middle of the exposure of a frame that is stamped `at`.
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

    /// How long after its trigger pulse the middle of a frame's exposure lies.
    #[must_use]
    pub fn after_pulse(&self) -> ExposureDelay {
        let [least, most] = self.middle_after_start();
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        ExposureDelay { least_us: us(least), most_us: us(most + REACTION) }
    }
}

/// Counts frames that the driver dropped, from its sequence numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct SequenceWatch {
    last: Option<u32>,
    missed: u64,
}

impl SequenceWatch {
    /// Takes the next frame's number; returns how many were missed before it.
    pub fn note(&mut self, sequence: u32) -> u64 {
        let gap = self.last.map_or(0, |last| u64::from(sequence.wrapping_sub(last).saturating_sub(1)));
        // A driver that starts over has not missed four thousand million frames.
        let gap = if gap > u64::from(u32::MAX / 2) { 0 } else { gap };
        self.last = Some(sequence);
        self.missed += gap;
        gap
    }

    /// How many were missed in all.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stamp_is_moved_to_mid_exposure() {
        let ms = Duration::from_millis;
        let timing = FrameTiming { period: ms(30), exposure: Some(ms(10)), rolling: ms(0), readout: ms(20) };
        let middle = |timing: FrameTiming, marks| {
            let MiddleOfExposure { at, error } = timing.middle(ms(1000), marks);
            [at, error].map(|time| time.as_millis())
        };
        assert_eq!(middle(timing, StampedAt::Start), [1005, 0]);
        // Between 975, where reading out took all of its time, and 995.
        assert_eq!(middle(timing, StampedAt::End), [985, 10]);
        let rolling = FrameTiming { rolling: ms(8), ..timing };
        assert_eq!(middle(rolling, StampedAt::Start), [1009, 0]);
        // A camera that does not say how long it exposes may do so for a whole period.
        let automatic = FrameTiming { exposure: None, ..rolling };
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
