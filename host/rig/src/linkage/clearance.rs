//! How far a shape of the trunk is from what must not happen: a loop that does not close, bodies that touch, joints at their
//! ends.

use std::f64::consts::PI;

use nalgebra::Vector2;

use super::{Corners, Gap, SixBar, TrunkBodies, TrunkCameras};

/// The trunk with both folds flat, and what bounds its shapes. Driven are the corners A, B and C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatTrunk {
    /// Lengths of the links.
    pub links: SixBar,
    /// Places of the cameras.
    pub cameras: TrunkCameras,
    /// Sizes of the bodies.
    pub bodies: TrunkBodies,
    /// Limits of the joints.
    pub limits: CornerLimits,
}

/// Limits of the joints: angles in radians, per second, and per second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerLimits {
    /// Smallest and largest interior angle of A, B and C.
    pub driven: [[f64; 2]; 3],
    /// Smallest and largest interior angle of D, E and F.
    pub passive: [f64; 2],
    /// Smallest and largest interior angle of the rear and of the front fold.
    pub folds: [[f64; 2]; 2],
    /// Greatest speed of a driven joint.
    pub speed: f64,
    /// Greatest acceleration of a driven joint.
    pub acceleration: f64,
    /// Greatest speed of a passive corner.
    pub passive_speed: f64,
}

impl CornerLimits {
    /// Time in seconds of a way of the joint that moves most, in radians: from rest to rest with constant acceleration, constant speed
    /// and constant braking.
    pub(super) fn seconds(&self, way: f64) -> f64 {
        let rises = self.speed * self.speed / self.acceleration;
        let rising = self.rising_seconds(way);
        if way < rises { 2.0 * rising } else { way / self.speed + rising }
    }

    /// The part of that time in which it speeds up.
    pub(super) fn rising_seconds(&self, way: f64) -> f64 {
        let rises = self.speed * self.speed / self.acceleration;
        (way.min(rises).max(0.0) / self.acceleration).sqrt()
    }
}

impl Default for CornerLimits {
    /// Ranges of the robot's servos (20 to 290 degrees for A and C, up to 270 for B, 0 to 240 for the folds) and of the published model's joints (3 rad
    /// from straight, so that 8.1 degrees are left between links). Speeds are assumed: 60 degrees a second, reached in half a
    /// second, for a corner without motor three times as much.
    fn default() -> Self {
        let [folded, open] = [PI - 3.0, PI + 3.0];
        let end = [20_f64.to_radians(), 290_f64.to_radians()];
        let speed = 60_f64.to_radians();
        Self {
            driven: [end, [folded, 270_f64.to_radians()], end],
            passive: [folded, open],
            folds: [[0.0, 240_f64.to_radians()]; 2],
            speed,
            acceleration: 2.0 * speed,
            passive_speed: 3.0 * speed,
        }
    }
}

/// How much room a shape has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Angle in radians by which every driven corner may be off at once, to the worst sides, before the loop cannot close or folds
    /// onto itself: to first order. Zero at a dead centre.
    pub loop_reserve: f64,
    /// Angle in radians to the nearest end of a joint's range; negative beyond.
    pub joint_range: f64,
    /// The nearest bodies.
    pub gap: Gap,
}

/// The clearance that a path must keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedClearance {
    /// Least [`Clearance::loop_reserve`] in radians.
    pub loop_reserve: f64,
    /// Least distance of bodies in millimetres.
    pub gap_mm: f64,
}

impl Default for WantedClearance {
    /// One degree, three times the play of a joint that a worn servo has; 3 mm.
    fn default() -> Self {
        Self { loop_reserve: 1_f64.to_radians(), gap_mm: 3.0 }
    }
}

impl Clearance {
    /// Whether links or cameras touch, or a joint is beyond its range.
    #[must_use]
    pub fn is_forbidden(&self) -> bool {
        self.gap.mm <= 0.0 || self.joint_range < -RANGE_ROUNDING
    }

    /// Whether this shape has the room wanted.
    #[must_use]
    pub fn has(&self, wanted: &WantedClearance) -> bool {
        !self.is_forbidden() && self.loop_reserve >= wanted.loop_reserve && self.gap.mm >= wanted.gap_mm
    }
}

/// What rounding to a servo's steps may put a shape beyond a limit: a tenth of a degree.
const RANGE_ROUNDING: f64 = 2e-3;

impl FlatTrunk {
    /// The clearance of a closed shape.
    #[must_use]
    pub fn clearance(&self, shape: &Corners) -> Clearance {
        Clearance {
            loop_reserve: self.loop_reserve(shape),
            joint_range: self.joint_range(shape),
            gap: self.bodies.gap(&self.links, &self.cameras, shape),
        }
    }

    /// Corners D and F must not be farther apart than both links between them reach, nor coincide. The distance changes with each
    /// driven corner by the lever of its axis.
    pub(crate) fn loop_reserve(&self, shape: &Corners) -> f64 {
        let places = self.links.places(shape);
        let [a, b, c, d, _, f] = places;
        let way = f - d;
        let apart = way.norm();
        if apart == 0.0 {
            return 0.0;
        }
        let lever = |axis: Vector2<f64>| (way / apart).perp(&(d - axis)).abs();
        let room = (2.0 * self.links.side - apart).clamp(0.0, apart);
        room / (lever(a) + lever(b) + lever(c)).max(f64::MIN_POSITIVE)
    }

    pub(super) fn joint_range(&self, shape: &Corners) -> f64 {
        let Corners([a, b, c, d, e, f]) = *shape;
        let passive = self.limits.passive;
        let driven = [a, b, c].into_iter().zip(self.limits.driven);
        let ranges = driven.chain([d, e, f].map(|angle| (angle, passive)));
        ranges.map(|(angle, [low, high])| (angle - low).min(high - angle)).fold(f64::INFINITY, f64::min)
    }
}
