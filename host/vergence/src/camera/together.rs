//! Frames of two cameras that run freely: which of them belong together.
//!
//! Both drivers stamp alike, so that the stamps tell how far apart two exposures are better than either tells when it was.

use std::collections::VecDeque;
use std::time::Duration;

use vergence_rig::{ExposureDelay, Fate, FramePairing, HostInstant, StampedFrame, TimedEvent};

use super::{Camera, Frame};
use crate::failure::Failure;

/// Frames farther apart than this part of a period may belong to either of two neighbours.
const WITHIN: f64 = 0.49;
/// So many frames without a partner are no accident.
const MOST_ALONE: usize = 300;

/// A pairing of right frames with left ones for cameras that take one each `period`.
#[must_use]
pub fn side_by_side(period: Duration) -> FramePairing {
    let period_us = period.as_secs_f64() * 1e6;
    let within = WITHIN * period_us;
    FramePairing::new(ExposureDelay { least_us: -within, most_us: within }, period_us)
}

/// A left frame as the event that a right one is paired with.
#[must_use]
pub fn as_event(seq: u32, middle: HostInstant) -> TimedEvent {
    TimedEvent { seq, at: HostInstant { error_us: 0.0, ..middle } }
}

/// A right frame, placed by its stamp alone.
#[must_use]
pub fn as_stamped(seq: u32, middle: HostInstant) -> StampedFrame {
    StampedFrame { seq, middle: HostInstant { error_us: 0.0, ..middle } }
}

/// One camera, or two whose frames are taken together: those with stamps by time, others in turn.
pub struct CameraSet {
    cameras: Vec<Box<dyn Camera>>,
    pairing: Option<FramePairing>,
    waiting: [VecDeque<(u32, Frame)>; 2],
    alone: u64,
}

impl CameraSet {
    /// These cameras.
    #[must_use]
    pub fn new(cameras: Vec<Box<dyn Camera>>) -> Self {
        let periods = cameras.iter().map(|camera| camera.timing().map(|timing| timing.period));
        let slowest = periods.collect::<Option<Vec<_>>>().and_then(|periods| periods.into_iter().max());
        let pairing = slowest.filter(|_| cameras.len() == 2).map(side_by_side);
        Self { cameras, pairing, waiting: Default::default(), alone: 0 }
    }

    /// How many frames had no partner.
    #[must_use]
    pub const fn alone(&self) -> u64 {
        self.alone
    }

    /// How many frames of all cameras were lost before they came here.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.cameras.iter().map(|camera| camera.missed()).sum()
    }

    /// The next frame of each camera, taken together.
    ///
    /// # Errors
    /// Those of the cameras; cameras that are never exposed together.
    pub fn grab(&mut self) -> Result<Vec<Frame>, Failure> {
        let Self { cameras, pairing, waiting, alone } = self;
        let mut one_of_each = || cameras.iter_mut().map(|camera| grab(camera.as_mut())).collect::<Result<Vec<_>, _>>();
        let Some(pairing) = pairing else { return one_of_each() };
        for _ in 0..MOST_ALONE {
            for (side, frame) in one_of_each()?.into_iter().enumerate() {
                let (Some(seq), Some(middle)) = (frame.seq, frame.exposed_at) else { continue };
                waiting[side].push_back((seq, frame));
                if side == 0 { pairing.event(as_event(seq, middle)) } else { pairing.frame(as_stamped(seq, middle)) }
            }
            let mut newest = None;
            while let Some(fate) = pairing.take() {
                match fate {
                    Fate::Paired { event, frame } => {
                        *alone += u64::from(newest.is_some());
                        newest = Some((take(&mut waiting[0], event), take(&mut waiting[1], frame)));
                    }
                    Fate::EventAlone(left) => *alone += u64::from(take(&mut waiting[0], left).is_some()),
                    Fate::FrameAlone(right) | Fate::Ambiguous(right) => {
                        *alone += u64::from(take(&mut waiting[1], right).is_some());
                    }
                }
            }
            if let Some((Some(left), Some(right))) = newest {
                return Ok(vec![left, right]);
            }
            pairing.settle(waiting[0].back().map_or(0.0, |(_, frame)| settled_before(frame)));
        }
        Err(Failure::device(format!(
            "in {MOST_ALONE} frames the two cameras never took one together: check that both run at the same rate"
        )))
    }
}

fn grab(camera: &mut dyn Camera) -> Result<Frame, Failure> {
    camera.grab()?.ok_or_else(|| Failure::device("a camera ended"))
}

/// What was exposed a second before `frame` has its partner, or none.
fn settled_before(frame: &Frame) -> f64 {
    frame.exposed_at.map_or(0.0, |at| at.us - 1e6)
}

/// The frame numbered `seq`, and away with those before it.
fn take(waiting: &mut VecDeque<(u32, Frame)>, seq: u32) -> Option<Frame> {
    let index = waiting.iter().position(|(number, _)| *number == seq)?;
    waiting.drain(..index);
    waiting.pop_front().map(|(_, frame)| frame)
}

#[cfg(test)]
mod tests {
    use super::super::FrameTiming;
    use super::*;

    const PERIOD: Duration = Duration::from_millis(40);

    /// Frames at 25 Hz from number `first`, exposed `late` after the grid, some of which are lost.
    struct Ticking {
        next: u32,
        late: Duration,
        lost: &'static [u32],
        missed: u64,
    }

    impl Camera for Ticking {
        fn grab(&mut self) -> Result<Option<Frame>, Failure> {
            while self.lost.contains(&self.next) {
                self.next += 1;
                self.missed += 1;
            }
            let seq = self.next;
            self.next += 1;
            let us = (PERIOD * seq + self.late).as_secs_f64() * 1e6;
            let exposed_at = Some(HostInstant { us, error_us: 20_000.0 });
            let image = image::RgbImage::new(1, 1);
            Ok(Some(Frame { image, name: seq.to_string(), seq: Some(seq), exposed_at }))
        }

        fn timing(&self) -> Option<FrameTiming> {
            Some(FrameTiming { period: PERIOD, exposure: None, rolling: Duration::ZERO, readout: PERIOD })
        }

        fn missed(&self) -> u64 {
            self.missed
        }
    }

    fn ticking(late_ms: u64, lost: &'static [u32]) -> Box<dyn Camera> {
        Box::new(Ticking { next: 0, late: Duration::from_millis(late_ms), lost, missed: 0 })
    }

    #[test]
    fn lost_frames_do_not_shift_the_others() {
        let mut set = CameraSet::new(vec![ticking(0, &[3, 7, 8]), ticking(9, &[1, 2, 8, 9])]);
        let mut seen = Vec::new();
        while seen.last().is_none_or(|&last| last < 20) {
            let names: Vec<_> = set.grab().expect("they run").into_iter().map(|frame| frame.name).collect();
            assert_eq!(names[0], names[1]);
            seen.push(names[0].parse::<u32>().expect("a number"));
        }
        assert!(!seen.contains(&3) && !seen.contains(&1) && seen.contains(&4), "{seen:?}");
        assert!(set.alone() > 0);
        assert_eq!(set.missed(), 7);
    }

    /// Halfway between two frames nobody can tell which of them is meant.
    #[test]
    fn cameras_out_of_step_are_told() {
        let mut set = CameraSet::new(vec![ticking(0, &[]), ticking(20, &[])]);
        assert!(set.grab().is_err_and(|failure| failure.to_string().contains("same rate")));
    }
}
