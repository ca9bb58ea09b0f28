//! The stream of encoder readings, and the joints at an instant between two of them.

use std::collections::VecDeque;

use vergence_protocol::{AxisList, Counts, Microseconds};

use crate::clock::BoardInstant;

/// Longest interval between two readings over which counts are interpolated.
const LONGEST_GAP_US: f64 = 100_000.0;

/// One reading of all encoders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointSample {
    /// The instant when the encoders were latched, on the board's clock.
    pub at: Microseconds,
    /// Counts of each axis from its zero.
    pub counts: AxisList<Counts>,
}

/// The joint positions at one instant, in counts.
#[derive(Clone, Debug, PartialEq)]
pub struct JointsAt {
    /// Interpolated counts of each axis from its zero.
    pub counts: Vec<f64>,
    /// Standard deviation of each axis by itself, in counts: from the rounding of readings to the encoder's step, and from
    /// motion between two readings that is not uniform.
    pub sigma: Vec<f64>,
    /// Movement of each axis, in counts, while the instant is off by one standard deviation, with the sign of the
    /// motion. These errors are fully correlated, because the instant is common to all axes.
    pub timing: Vec<f64>,
}

/// The standard deviation of an error that is uniform over a width of one: 1/√12.
pub(crate) const UNIFORM: f64 = 0.288_675_134_594_812_9;

impl JointsAt {
    /// The joints from counts that the board latched at the instant itself, as at the edge of a trigger pulse.
    #[must_use]
    pub fn latched(counts: &[Counts]) -> Self {
        Self {
            counts: counts.iter().map(|counts| f64::from(counts.0)).collect(),
            sigma: vec![UNIFORM; counts.len()],
            timing: vec![0.0; counts.len()],
        }
    }
}

/// Why the joints at an instant are not known.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackGap {
    /// No reading after the instant has arrived yet.
    #[error("no encoder reading after the exposure has arrived yet")]
    NotYet,
    /// The instant is older than all readings kept.
    #[error("the exposure is older than the encoder readings kept")]
    TooOld,
    /// The readings around the instant are too far apart; the interval is in milliseconds.
    #[error("encoder readings are missing around the exposure ({0:.0} ms gap)")]
    Gap(f64),
}

/// A source of the joint positions at an instant.
pub trait Joints {
    /// The joints at `instant`.
    ///
    /// # Errors
    /// [`TrackGap`] where the joints are not known at that instant.
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap>;
}

/// Axes that move at constant stated speeds, or stand.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyMotion {
    /// The reference instant, in microseconds on the board's clock.
    pub from_us: f64,
    /// The joints at the reference instant.
    pub joints: JointsAt,
    /// Speed of each axis in counts per microsecond.
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

/// A track of the latest encoder readings, in order of time.
#[derive(Clone, Debug)]
pub struct JointTrack {
    samples: VecDeque<JointSample>,
    capacity: usize,
}

impl JointTrack {
    /// Makes an empty track that keeps up to `capacity` readings, at least two.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self { samples: VecDeque::new(), capacity: capacity.max(2) }
    }

    /// Adds a reading. One that is not later than the last, or has another number of axes, clears the track first: the
    /// board has restarted.
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

    /// Copies the part from `from_us` to `to_us` on the board's clock, with the readings needed to interpolate at both
    /// ends.
    #[must_use]
    pub fn between(&self, from_us: f64, to_us: f64) -> Self {
        // The readings around each end, and their neighbours, from which `bend` estimates the curvature of the motion.
        const BESIDE: usize = 2;
        let first = self.reading_from(from_us).saturating_sub(BESIDE);
        let end = (self.reading_from(to_us) + BESIDE).min(self.samples.len());
        let samples = self.samples.range(first.min(end)..end).cloned().collect();
        Self { samples, capacity: self.capacity }
    }

    /// Index of the first reading at or after an instant on the board's clock.
    fn reading_from(&self, us: f64) -> usize {
        self.samples.partition_point(|sample| (sample.at.0 as f64) < us)
    }
}

impl Joints for JointTrack {
    /// Interpolates linearly between the two readings around `instant`.
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
    /// The possible deviation of each axis from linear motion between two readings, in counts: share (1 - share) / 2 of
    /// the change of its step from this interval to the neighbouring ones, the larger of both.
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

/// Interpolates at the fraction `share` between two readings. `instant_error` is the bound of the instant's error as a
/// fraction of their interval.
fn interpolate(previous: &JointSample, next: &JointSample, share: f64, bend: &[f64], instant_error: f64) -> JointsAt {
    let mut joints = JointsAt { counts: Vec::new(), sigma: Vec::new(), timing: Vec::new() };
    for ((before, after), bend) in previous.counts.iter().zip(&next.counts).zip(bend) {
        let step = f64::from(after.0) - f64::from(before.0);
        joints.counts.push(f64::from(before.0) + share * step);
        // Two readings of an axis that moved are rounded by themselves; one that stands is rounded alike in both.
        let rounding = if step.abs() > 1.0 { UNIFORM * (1.0 - share).hypot(share) } else { UNIFORM };
        joints.sigma.push(rounding.hypot(*bend));
        joints.timing.push(UNIFORM * 2.0 * instant_error * step);
    }
    joints
}
