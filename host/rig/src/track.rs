//! The encoder stream, and the joints at an instant between two of its samples.

use std::collections::VecDeque;

use vergence_protocol::{AxisList, Counts, Microseconds};

use crate::clock::BoardInstant;

/// Two samples further apart than this say nothing of the time between them.
const LONGEST_GAP_US: f64 = 100_000.0;

/// One reading of all encoders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointSample {
    /// When they were latched, board clock.
    pub at: Microseconds,
    /// Counts from the axis zero.
    pub counts: AxisList<Counts>,
}

/// The joints at one instant, in counts.
#[derive(Clone, Debug, PartialEq)]
pub struct JointsAt {
    /// Interpolated counts of each axis.
    pub counts: Vec<f64>,
    /// Standard deviation of each by itself, in counts: the encoder's step, and what the motion between two readings may
    /// have done besides going straight.
    pub sigma: Vec<f64>,
    /// How far each moves while the instant is off by one standard deviation, in counts. The instant is the same for all
    /// axes, so these errors go together; the sign is that of the motion.
    pub timing: Vec<f64>,
}

/// The standard deviation of an error anywhere within a width of one: 1/√12.
pub(crate) const UNIFORM: f64 = 0.288_675_134_594_812_9;

impl JointsAt {
    /// Counts that the board latched at the very instant, as at the edge of a trigger pulse.
    #[must_use]
    pub fn latched(counts: &[Counts]) -> Self {
        Self {
            counts: counts.iter().map(|counts| f64::from(counts.0)).collect(),
            sigma: vec![UNIFORM; counts.len()],
            timing: vec![0.0; counts.len()],
        }
    }
}

/// Why the track does not know the joints at an instant.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackGap {
    /// The encoder stream has not reached the instant yet.
    #[error("no encoder reading after the exposure has arrived yet")]
    NotYet,
    /// The instant is older than everything remembered.
    #[error("the exposure is older than the remembered encoder readings")]
    TooOld,
    /// The readings around the instant are too far apart.
    #[error("encoder readings are missing around the exposure ({0:.0} ms gap)")]
    Gap(f64),
}

/// Who knows the joints at an instant.
pub trait Joints {
    /// The joints at `instant`.
    ///
    /// # Errors
    /// [`TrackGap`] where they are not known then.
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap>;
}

/// Axes that move evenly, or stand, as somebody said.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyMotion {
    /// The instant from which time counts, microseconds on the board's clock.
    pub from_us: f64,
    /// The joints then.
    pub joints: JointsAt,
    /// How fast each moves, in counts per microsecond.
    pub rates: Vec<f64>,
}

impl Joints for SteadyMotion {
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap> {
        let mut joints = self.joints.clone();
        let moving = joints.counts.iter_mut().zip(&mut joints.timing).zip(&self.rates);
        for ((counts, timing), rate) in moving {
            *counts += rate * (instant.us - self.from_us);
            *timing = timing.hypot(UNIFORM * 2.0 * instant.error_us * rate).copysign(*rate);
        }
        Ok(joints)
    }
}

/// The latest readings of the encoders, in order of time.
#[derive(Clone, Debug)]
pub struct JointTrack {
    samples: VecDeque<JointSample>,
    capacity: usize,
}

impl JointTrack {
    /// Remembers `capacity` samples, at least two.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self { samples: VecDeque::new(), capacity: capacity.max(2) }
    }

    /// Takes a reading. One that is not later than the last, or has another number of axes, begins a new track: the
    /// board has started anew.
    pub fn push(&mut self, sample: JointSample) {
        let follows = |last: &JointSample| sample.at > last.at && sample.counts.len() == last.counts.len();
        if !self.samples.back().is_none_or(follows) {
            self.samples.clear();
        }
        if self.samples.len() == self.capacity {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// The part from `from_us` to `to_us` on the board's clock, with what it takes to interpolate at both.
    #[must_use]
    pub fn between(&self, from_us: f64, to_us: f64) -> Self {
        // The readings around each end, and those beside them, which tell how the motion bends.
        const BESIDE: usize = 2;
        let first = self.reading_from(from_us).saturating_sub(BESIDE);
        let end = (self.reading_from(to_us) + BESIDE).min(self.samples.len());
        let samples = self.samples.range(first.min(end)..end).cloned().collect();
        Self { samples, capacity: self.capacity }
    }

    /// The first reading at or after an instant on the board's clock.
    fn reading_from(&self, us: f64) -> usize {
        self.samples.partition_point(|sample| (sample.at.0 as f64) < us)
    }
}

impl Joints for JointTrack {
    /// By linear interpolation between the two readings around `instant`.
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap> {
        let after = self.reading_from(instant.us);
        let next = self.samples.get(after).ok_or(TrackGap::NotYet)?;
        let previous = match after.checked_sub(1).and_then(|before| self.samples.get(before)) {
            Some(previous) => previous,
            None if (next.at.0 as f64) - instant.us < 0.5 => next,
            None => return Err(TrackGap::TooOld),
        };
        let span = (next.at.0 - previous.at.0) as f64;
        if span > LONGEST_GAP_US {
            return Err(TrackGap::Gap(span / 1000.0));
        }
        let share = if span > 0.0 { (instant.us - previous.at.0 as f64) / span } else { 0.0 };
        let bend = self.bend(after, share);
        Ok(interpolate(previous, next, share, &bend, instant.error_us / span.max(1.0)))
    }
}

impl JointTrack {
    /// How far each axis may be off the straight line between two readings: share (1 - share) / 2 of the change of its
    /// step from this interval to those beside it, the larger of both.
    fn bend(&self, after: usize, share: f64) -> Vec<f64> {
        let step = |to: usize, axis: usize| {
            let counts = |index: usize| Some(f64::from(self.samples.get(index)?.counts.get(axis)?.0));
            Some(counts(to)? - counts(to.checked_sub(1)?)?)
        };
        let axes = self.samples.get(after).map_or(0, |sample| sample.counts.len());
        let of_axis = |axis| {
            let here = step(after, axis)?;
            let beside = [after.checked_sub(1).and_then(|before| step(before, axis)), step(after + 1, axis)];
            let change = beside.into_iter().flatten().map(|there| (there - here).abs()).fold(0.0, f64::max);
            Some(0.5 * share * (1.0 - share) * change)
        };
        (0..axes).map(|axis| of_axis(axis).unwrap_or(0.0)).collect()
    }
}

/// `instant_error` is the bound of the instant's error as a share of the span between the readings.
fn interpolate(previous: &JointSample, next: &JointSample, share: f64, bend: &[f64], instant_error: f64) -> JointsAt {
    let mut joints = JointsAt { counts: Vec::new(), sigma: Vec::new(), timing: Vec::new() };
    for ((before, after), bend) in previous.counts.iter().zip(&next.counts).zip(bend) {
        let step = f64::from(after.0) - f64::from(before.0);
        joints.counts.push(f64::from(before.0) + share * step);
        joints.sigma.push(UNIFORM.hypot(*bend));
        joints.timing.push(UNIFORM * 2.0 * instant_error * step);
    }
    joints
}
