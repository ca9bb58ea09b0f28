//! The trunk with its folds, and what bounds its shapes: how far each is from a loop that does not close, from bodies that touch, and
//! from the ends of the joints.
//!
//! Folded, the trunk has two freedoms: the angle of both side joints, and that of both folds. Its five servos then hold it more than
//! once: what they differ from a closed loop bends the links.

use std::f64::consts::PI;

use nalgebra::{Rotation3, Vector3};

use super::bodies::{Capsule, nearest};
use super::{Clearance, FlatTrunk, Gap, TrunkBody, TrunkLinks, TrunkShape};

/// The trunk, and what bounds its shapes. Driven are the corners A, B and C, and both folds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoldingTrunk {
    /// The trunk with flat folds.
    pub flat: FlatTrunk,
    /// Lengths of the links.
    pub links: TrunkLinks,
}

impl FoldingTrunk {
    /// The clearance of a closed shape.
    #[must_use]
    pub fn clearance(&self, shape: &TrunkShape) -> Clearance {
        if shape.is_flat() {
            return self.flat.clearance(&shape.corners);
        }
        self.folded_clearance(shape)
    }

    /// As [`Self::clearance`], with bodies and levers in space also where the folds are flat.
    pub(super) fn folded_clearance(&self, shape: &TrunkShape) -> Clearance {
        let folds = self.flat.limits.folds.into_iter();
        let of_folds = folds.map(|[low, high]| (shape.fold - low).min(high - shape.fold)).fold(f64::INFINITY, f64::min);
        Clearance {
            loop_reserve: self.loop_reserve(shape),
            joint_range: self.flat.joint_range(&shape.corners).min(of_folds),
            gap: self.gap(shape),
        }
    }

    /// The turn of the right half against the left one about the hinges, which lie above the corners' plane. As the loop has it, the
    /// halves turn down where the angle of the folds is less than half a turn.
    fn fold(&self, shape: &TrunkShape) -> impl Fn(Vector3<f64>) -> Vector3<f64> + use<> {
        let hinge = Vector3::z() * self.links.fold_offset;
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), PI - shape.fold);
        move |place| turn * (place - hinge) + hinge
    }

    /// Corners D and F must not be farther apart than both links between them reach, as with flat folds: see
    /// [`Clearance::loop_reserve`]. Their line lies along the hinges, so that an error of a fold changes their distance to second order
    /// only.
    fn loop_reserve(&self, shape: &TrunkShape) -> f64 {
        let [a, b, c, d, _, f] = self.flat.links.places(&shape.corners);
        let fold = self.fold(shape);
        let [d, f] = [d, f].map(|place| fold(place.push(0.0)));
        let way = f - d;
        let apart = way.norm();
        let lever = |axis: nalgebra::Vector2<f64>| (way / apart).dot(&Vector3::z().cross(&(d - axis.push(0.0)))).abs();
        let room = (2.0 * self.flat.links.side - apart).clamp(0.0, apart);
        room / (lever(a) + lever(b) + lever(c)).max(f64::MIN_POSITIVE)
    }

    /// The two bodies that are nearest to each other, those that share a corner or a hinge left out. All bodies are taken as round.
    fn gap(&self, shape: &TrunkShape) -> Gap {
        let places = self.flat.links.places(&shape.corners);
        let [left, right] = self.flat.cameras.centres(&places);
        let fold = self.fold(shape);
        let middle = |one: usize, other: usize| ((places[one] + places[other]) / 2.0).push(0.0);
        let [[a, b, c, _, _, _], [_, _, _, d, e, f]] =
            [places.map(|place| place.push(0.0)), places.map(|place| fold(place.push(0.0)))];
        let (front, rear) = (middle(0, 5), middle(2, 3));
        let radius = self.flat.bodies.link;
        let link = |number, ends| Capsule { body: TrunkBody::Link(number), ends, radius };
        let camera = |body, centre| Capsule { body, ends: [centre; 2], radius: self.flat.bodies.camera };
        let heights = [self.flat.cameras.left.height, self.flat.cameras.right.height];
        let bodies = [
            link(5, [front, a]),
            link(0, [a, b]),
            link(1, [b, c]),
            link(2, [c, rear]),
            link(2, [fold(rear), d]),
            link(3, [d, e]),
            link(4, [e, f]),
            link(5, [f, fold(front)]),
            camera(TrunkBody::LeftCamera, left.push(heights[0])),
            camera(TrunkBody::RightCamera, fold(right.push(heights[1]))),
        ];
        // Links follow each other round the loop; cameras ride on the links of these places.
        nearest(&bodies, |one, other| match (one, other) {
            (8, link) | (link, 8) if link < 8 => link == 1,
            (9, link) | (link, 9) if link < 8 => link == 6,
            (8 | 9, _) | (_, 8 | 9) => false,
            _ => matches!(one.abs_diff(other), 1 | 7),
        })
    }
}
