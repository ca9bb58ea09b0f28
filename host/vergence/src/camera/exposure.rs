//! When a frame was exposed, from the kernel's time stamp.

use std::time::Duration;

/// What the time stamp of a driver marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampedAt {
    /// Start of the exposure.
    Start,
    /// The frame was complete: exposed and read out.
    End,
}

/// Kernel time stamp, what it marks, and how long exposure and readout took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// On the monotonic clock.
    pub at: Duration,
    /// What it marks.
    pub marks: StampedAt,
    /// How long the sensor was exposed; zero where the camera does not say.
    pub exposure: Duration,
    /// Readout and transfer; a frame period where the camera does not say.
    pub readout: Duration,
}

impl Stamp {
    /// The middle of the exposure on the same clock.
    #[must_use]
    pub fn mid_exposure(&self) -> Duration {
        match self.marks {
            StampedAt::Start => self.at + self.exposure / 2,
            // The readout may overlap the next exposure but always follows its own.
            StampedAt::End => self.at.saturating_sub(self.readout).saturating_sub(self.exposure / 2),
        }
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
        let stamp = Stamp { at: ms(1000), marks: StampedAt::Start, exposure: ms(10), readout: ms(20) };
        assert_eq!(stamp.mid_exposure(), ms(1005));
        assert_eq!(Stamp { marks: StampedAt::End, ..stamp }.mid_exposure(), ms(975));
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
