//! A move as the board will plan it: the same profiles from the same limits, so that it can be read before it is made.

use vergence_control::{Limits, Profile};
use vergence_protocol::AxisInfo;
use vergence_rig::{AxisPosition, Rig, RigAxis};

/// A planned move of all axes, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct MovePlan {
    /// Seconds; all axes start and finish together.
    pub duration: f64,
    /// One for each axis of the rig.
    pub axes: Vec<AxisPlan>,
}

/// What one axis does.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisPlan {
    /// From where.
    pub from: AxisPosition,
    /// To where.
    pub to: AxisPosition,
    /// Where each segment begins, and the end; empty where the axis stays.
    pub knots: Vec<Knot>,
}

/// An instant at which the jerk changes. In seconds and the unit of the axis: millimetres or radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Since the start of the move.
    pub time: f64,
    /// Where the axis is.
    pub position: f64,
    /// Per second.
    pub velocity: f64,
    /// Per second squared.
    pub acceleration: f64,
    /// Per second cubed, from here to the next knot; zero at the end.
    pub jerk: f64,
}

impl MovePlan {
    /// Plans the move of `rig` between two poses, within the limits that the board states for its axes.
    #[must_use]
    pub fn new(rig: &Rig, limits: &[AxisInfo], from: &[AxisPosition], to: &[AxisPosition]) -> Self {
        let quickest: Vec<_> = from
            .iter()
            .zip(to)
            .zip(limits)
            .map(|((from, to), info)| {
                let distance = i64::from(to.micro().0) - i64::from(from.micro().0);
                let [speed, acceleration, jerk] = [info.speed, info.acceleration, info.jerk].map(|limit| limit as f32);
                Profile::rest_to_rest(distance as f32, Limits { speed, acceleration, jerk })
            })
            .collect();
        let slowest = quickest.iter().map(Profile::duration).fold(0.0, f32::max);
        let ways = from.iter().zip(to).zip(quickest);
        let axes = rig.axes.iter().zip(ways).map(|(axis, ((&from, &to), profile))| {
            let knots = knots(axis, from, &profile.lasting(slowest));
            AxisPlan { from, to, knots }
        });
        Self { duration: f64::from(slowest), axes: axes.collect() }
    }
}

impl AxisPlan {
    /// The largest speed on the way, per second.
    #[must_use]
    pub fn peak_speed(&self) -> f64 {
        self.knots.iter().map(|knot| knot.velocity.abs()).fold(0.0, f64::max)
    }
}

/// Integrated in double precision: at rest is exactly at rest.
fn knots(axis: &RigAxis, from: AxisPosition, profile: &Profile) -> Vec<Knot> {
    let mut knots = Vec::new();
    let mut at = Knot { time: 0.0, position: from.value(), velocity: 0.0, acceleration: 0.0, jerk: 0.0 };
    for (duration, jerk) in profile.segments() {
        let (t, jerk) = (f64::from(duration), axis.value_from_micro(f64::from(jerk)));
        knots.push(Knot { jerk, ..at });
        at = Knot {
            time: at.time + t,
            position: at.position + t * (at.velocity + t * (at.acceleration / 2.0 + t * jerk / 6.0)),
            velocity: at.velocity + t * (at.acceleration + t * jerk / 2.0),
            acceleration: at.acceleration + t * jerk,
            jerk: 0.0,
        };
    }
    if !knots.is_empty() {
        let (time, end) = (f64::from(profile.duration()), axis.value_from_micro(f64::from(profile.end())));
        knots.push(Knot { time, position: from.value() + end, velocity: 0.0, acceleration: 0.0, jerk: 0.0 });
    }
    knots
}
