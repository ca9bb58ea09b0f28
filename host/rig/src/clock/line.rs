//! The lines of offset and drift that the exchanges allow.
//!
//! They form a convex polygon with the offset at the newest exchange as one coordinate and the drift as the other. Each
//! limit is a half-plane that cuts it (Sutherland and Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974).

use super::Exchange;
use super::limit::{Limit, Side, WORST_DRIFT};
use super::wire::WireTimes;

/// Random walk of the drift with temperature: one part per million in a minute, here per square root of a microsecond.
const DRIFT_WALK: f64 = 1e-6 / 7_745.966_692_414_834;
/// Number of standard deviations of that walk by which limits are relaxed.
const WALK_DEVIATIONS: f64 = 2.0;

/// The set of all lines that the limits so far allow.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lines {
    /// The instant when the newest reply was received, in microseconds on the host's clock.
    reference: f64,
    /// Origin of the corners' offsets, which are many orders smaller than it.
    origin: f64,
    corners: Vec<Line>,
}

/// A line of the clock offset: `offset + drift · (host - reference)`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    offset: f64,
    drift: f64,
}

/// A range by its middle and half its width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    pub middle: f64,
    pub error: f64,
}

impl Lines {
    /// The lines of any possible drift that the `newest` exchange allows, without regard to the wire; `None` where
    /// there are none.
    pub(super) fn through(newest: &Exchange) -> Option<Self> {
        let [most, least] = newest.limits(WireTimes::NONE);
        let origin = 0.5 * (most.offset_us + least.offset_us);
        let drifted = WORST_DRIFT * (least.host_us - most.host_us);
        let reach = 0.5 * (most.offset_us - least.offset_us) + drifted;
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(offset, drift)| Line { offset: offset * reach, drift: drift * WORST_DRIFT });
        (reach > 0.0).then(|| Self { reference: least.host_us, origin, corners: corners.to_vec() })
    }

    /// The lines within both limits of an exchange, each relaxed by the possible change of the drift since; `None`
    /// where there are none.
    pub(super) fn narrowed(&self, limits: [Limit; 2]) -> Option<Self> {
        let corners = limits.iter().fold(self.corners.clone(), |corners, limit| self.cut(&corners, limit));
        (!corners.is_empty()).then_some(Self { corners, ..*self })
    }

    fn cut(&self, corners: &[Line], limit: &Limit) -> Vec<Line> {
        let after = limit.host_us - self.reference;
        let offset = limit.offset_us - self.origin;
        let room = |line: &Line| {
            let room = offset - line.at(after);
            walked(after) + if limit.side == Side::Most { room } else { -room }
        };
        let mut kept = Vec::with_capacity(corners.len() + 1);
        for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let (room_from, room_to) = (room(from), room(to));
            if room_from >= 0.0 {
                kept.push(*from);
            }
            if (room_from < 0.0) != (room_to < 0.0) {
                kept.push(from.towards(to, room_from / (room_from - room_to)));
            }
        }
        kept
    }

    /// The instant when the newest reply was received, in microseconds on the host's clock.
    pub(super) fn reference(&self) -> f64 {
        self.reference
    }

    /// The clock offset at `host`, in microseconds.
    pub(super) fn offset_at(&self, host: f64) -> Range {
        let after = host - self.reference;
        let Range { middle, error } = Range::of(self.corners.iter().map(|line| line.at(after)));
        Range { middle: self.origin + middle, error: error + walked(after) }
    }

    /// The relative drift at the reference instant.
    pub(super) fn drift(&self) -> Range {
        Range::of(self.corners.iter().map(|line| line.drift))
    }
}

impl Line {
    fn at(&self, after: f64) -> f64 {
        self.offset + self.drift * after
    }

    fn towards(&self, other: &Self, share: f64) -> Self {
        Self {
            offset: self.offset + share * (other.offset - self.offset),
            drift: self.drift + share * (other.drift - self.drift),
        }
    }
}

impl Range {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (least, most) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), v| (v.min(least), v.max(most)));
        Self { middle: 0.5 * (least + most), error: 0.5 * (most - least) }
    }
}

/// The deviation from a straight line in microseconds that the random walk of the drift causes in `span` microseconds.
/// The integral of Brownian motion has the variance `q² t³ / 3`.
fn walked(span: f64) -> f64 {
    let span = span.abs();
    WALK_DEVIATIONS * DRIFT_WALK * span * (span / 3.0).sqrt()
}
