//! One leg of a path: all driven joints run in a straight line, from rest to rest.

use super::{LONGEST_PASSAGE, Space};
use crate::linkage::{Clearance, CornerLimits, TrunkShape};

/// Coordinates of a shape in radians: see [`super::Shapes`].
pub(super) type Driven = [f64; 3];

/// Distance of the samples along a leg, in radians of the joint that moves most: half a degree.
const SAMPLE: f64 = 8.73e-3;

/// A shape along a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegSample {
    /// The share of the way, from 0 to 1.
    pub share: f64,
    /// The shape there.
    pub shape: TrunkShape,
    /// Its clearance.
    pub room: Clearance,
}

/// A straight way of the driven joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Shapes along the leg, with both ends.
    pub samples: Vec<LegSample>,
    /// Time in seconds from rest to rest, with the joints' limits.
    pub seconds: f64,
    /// Speed of the joint that moves most, in radians per second, which it does not exceed; lower than the joints' limit where a
    /// passive corner would be too fast.
    pub speed: f64,
    /// The part of that time in which it speeds up, and as much in which it brakes.
    rising: f64,
}

impl Leg {
    /// The sample nearest to the place at `seconds` after its start.
    pub(super) fn at(&self, seconds: f64) -> Option<&LegSample> {
        let (rising, total) = (self.rising, self.seconds);
        let whole = total - rising;
        let from_end = (total - seconds).max(0.0);
        let share = if seconds < rising {
            seconds * seconds / (2.0 * rising * whole)
        } else if from_end < rising {
            1.0 - from_end * from_end / (2.0 * rising * whole)
        } else {
            (seconds - rising / 2.0) / whole
        };
        let last = self.samples.len().checked_sub(1)?;
        self.samples.get((share.clamp(0.0, 1.0) * last as f64).round() as usize)
    }

    /// The shape at its end.
    #[must_use]
    pub fn end(&self) -> Option<&TrunkShape> {
        self.samples.last().map(|sample| &sample.shape)
    }
}

/// Way of the joint that moves most.
pub(super) fn longest(from: Driven, to: Driven) -> f64 {
    from.iter().zip(to).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
}

impl Space<'_> {
    /// The leg from one place to another. `None` where it is not allowed: the loop must close and nothing touch all along it, and it
    /// must have the wanted clearance but for a short passage at either end, along which the loop's reserve grows with the
    /// distance from that end.
    pub(super) fn leg(&self, from: Driven, to: Driven) -> Option<Leg> {
        let (way, limits) = (longest(from, to), self.shapes.limits());
        let pieces = (way / SAMPLE).ceil().max(1.0) as u32;
        let at = |piece: u32| {
            let share = f64::from(piece) / f64::from(pieces);
            // The end is that asked for, to the last digit.
            let along = |joint: usize| from[joint] + share * (to[joint] - from[joint]);
            let place = if piece == pieces { to } else { std::array::from_fn(along) };
            self.shape(place).map(|(shape, room)| LegSample { share, shape, room })
        };
        let samples: Vec<LegSample> = (0..=pieces).map(at).collect::<Option<_>>()?;
        let begins = self.passage(samples.iter(), way)?;
        let ends = self.passage(samples.iter().rev(), way)?;
        let inside = samples.get(begins..samples.len() - ends).unwrap_or_default();
        let is_clear = inside.iter().all(|sample| sample.room.has(&self.wanted));
        let [seconds, rising, slower] = durations(&samples, way, limits);
        let speed = limits.speed / slower;
        is_clear.then_some(Leg { seconds, speed, rising, samples })
    }

    /// Number of samples at the beginning that have less room than wanted; `None` if they are too many, or the loop's reserve does
    /// not grow along them.
    fn passage<'s>(&self, samples: impl Iterator<Item = &'s LegSample> + Clone, way: f64) -> Option<usize> {
        let tight = |sample: &&LegSample| !sample.room.has(&self.wanted);
        let count = samples.clone().take_while(tight).count();
        let mut passage = samples.take(count + 1);
        let mut last = passage.next()?;
        let begins = last.share;
        for sample in passage {
            let grows = sample.room.loop_reserve >= last.room.loop_reserve
                && sample.room.gap.mm >= last.room.gap.mm.min(self.wanted.gap_mm);
            if !grows || (sample.share - begins).abs() * way > LONGEST_PASSAGE {
                return None;
            }
            last = sample;
        }
        Some(count)
    }
}

/// Time from rest to rest with constant acceleration, constant speed and constant braking, the part in which it speeds up, and by how
/// much both are longer because a passive corner would exceed its speed.
fn durations(samples: &[LegSample], way: f64, limits: &CornerLimits) -> [f64; 3] {
    let CornerLimits { speed, acceleration, passive_speed, .. } = *limits;
    let (alone, rising) = (limits.seconds(way), limits.rising_seconds(way));
    let fastest = samples.windows(2).map(|pair| {
        let [from, to] = [pair[0], pair[1]];
        let middle = f64::midpoint(from.share, to.share) * way;
        let driven = speed.min((2.0 * acceleration * middle.min(way - middle)).sqrt());
        let turned =
            (3..6).map(|corner| (to.shape.corners.0[corner] - from.shape.corners.0[corner]).abs()).fold(0.0, f64::max);
        turned * driven / ((to.share - from.share) * way)
    });
    let slower = (fastest.fold(0.0, f64::max) / passive_speed).max(1.0);
    [alone * slower, rising * slower, slower]
}
