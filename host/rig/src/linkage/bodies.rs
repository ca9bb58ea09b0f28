//! The bodies of the trunk's links and cameras, and how far they are from each other while both folds are flat.

use nalgebra::{Rotation2, Vector2, Vector3};

use super::{CameraMount, Corners, SixBar, TrunkCameras};

/// Number of links of the planar trunk.
const LINKS: usize = 6;

/// Sizes of the trunk's bodies in millimetres, as seen along the axes of the corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkBodies {
    /// Half of the width of a link.
    pub link: f64,
    /// Radius of a camera's body around its optical centre.
    pub camera: f64,
}

impl Default for TrunkBodies {
    /// Assumed: no drawing of the robot is public. Links 30 mm wide, cameras 36 mm.
    fn default() -> Self {
        Self { link: 15.0, camera: 18.0 }
    }
}

/// A body of the trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrunkBody {
    /// The link from the corner of this number (A is 0) to the next.
    Link(usize),
    /// The camera on link AB.
    LeftCamera,
    /// The camera on link EF.
    RightCamera,
}

impl core::fmt::Display for TrunkBody {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Link(first) => {
                write!(f, "link {}", ["AB", "BC", "CD", "DE", "EF", "FA"].get(*first).copied().unwrap_or("?"))
            }
            Self::LeftCamera => write!(f, "the left camera"),
            Self::RightCamera => write!(f, "the right camera"),
        }
    }
}

/// The two bodies that are nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Distance of their surfaces in millimetres; negative where they overlap.
    pub mm: f64,
    /// The bodies.
    pub between: [TrunkBody; 2],
}

/// A body as a line with a radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    pub body: TrunkBody,
    pub ends: [Vector3<f64>; 2],
    pub radius: f64,
}

impl SixBar {
    /// Places of the corners A to F in millimetres, in the frame of link FA: origin at its middle, x towards F, y forward. The
    /// trunk lies behind it.
    #[must_use]
    pub fn places(&self, corners: &Corners) -> [Vector2<f64>; LINKS] {
        let lengths = [self.side, self.side, self.end, self.side, self.side, self.end];
        let mut at = Vector2::new(-self.end / 2.0, 0.0);
        // Seen from above, the corners from A on go round against the clock: back, to the right, forward.
        let mut heading = 0.0;
        let mut places = [at; LINKS];
        for corner in 0..LINKS {
            heading += std::f64::consts::PI - corners.0[corner];
            places[corner] = at;
            at += lengths[corner] * Vector2::new(-f64::cos(heading), -f64::sin(heading));
        }
        places
    }
}

impl TrunkCameras {
    /// Optical centres of the left and the right camera in millimetres, in the frame of [`SixBar::places`].
    #[must_use]
    pub fn centres(&self, places: &[Vector2<f64>; LINKS]) -> [Vector2<f64>; 2] {
        let [a, b, _, _, e, f] = *places;
        let mounted = |mount: &CameraMount, corner: Vector2<f64>, other: Vector2<f64>, outward: f64| {
            let along = (other - corner).normalize();
            corner + mount.along * along + mount.outward * (Rotation2::new(outward) * along)
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        [mounted(&self.left, a, b, -quarter), mounted(&self.right, f, e, quarter)]
    }
}

impl TrunkBodies {
    /// The two bodies of the flat trunk that are nearest to each other, those that share a corner left out: how far these may
    /// close is a limit of their joint.
    #[must_use]
    pub fn gap(&self, links: &SixBar, cameras: &TrunkCameras, corners: &Corners) -> Gap {
        let places = links.places(corners);
        let [left, right] = cameras.centres(&places);
        let link = |first: usize| Capsule {
            body: TrunkBody::Link(first),
            ends: [places[first], places[(first + 1) % LINKS]].map(|place| place.push(0.0)),
            radius: self.link,
        };
        let camera = |body, centre| Capsule { body, ends: [Vector2::push(&centre, 0.0); 2], radius: self.camera };
        let cameras = [camera(TrunkBody::LeftCamera, left), camera(TrunkBody::RightCamera, right)];
        let bodies: [Capsule; LINKS + 2] =
            std::array::from_fn(|body| if body < LINKS { link(body) } else { cameras[body - LINKS] });
        nearest(&bodies, |one, other| are_joined(bodies[one].body, bodies[other].body))
    }
}

/// The two of the `bodies` that are nearest to each other, those that `are_joined`, by their places in the list, left out.
pub(super) fn nearest(bodies: &[Capsule], are_joined: impl Fn(usize, usize) -> bool) -> Gap {
    let mut nearest = Gap { mm: f64::INFINITY, between: [TrunkBody::LeftCamera, TrunkBody::RightCamera] };
    for (first, one) in bodies.iter().enumerate() {
        for (second, other) in bodies.iter().enumerate().skip(first + 1) {
            if are_joined(first, second) {
                continue;
            }
            let mm = distance(one.ends, other.ends) - one.radius - other.radius;
            if mm < nearest.mm {
                nearest = Gap { mm, between: [one.body, other.body] };
            }
        }
    }
    nearest
}

/// Whether two bodies share a corner, or one carries the other.
fn are_joined(one: TrunkBody, other: TrunkBody) -> bool {
    match (one, other) {
        (TrunkBody::Link(one), TrunkBody::Link(other)) => {
            let apart = one.abs_diff(other);
            apart == 1 || apart == LINKS - 1
        }
        (TrunkBody::Link(link), TrunkBody::LeftCamera) => link == 0,
        (TrunkBody::Link(link), TrunkBody::RightCamera) => link == 4,
        _ => false,
    }
}

/// Distance of two line segments.
fn distance(one: [Vector3<f64>; 2], other: [Vector3<f64>; 2]) -> f64 {
    let ends =
        [to_segment(one[0], other), to_segment(one[1], other), to_segment(other[0], one), to_segment(other[1], one)];
    let nearest = ends.into_iter().fold(f64::INFINITY, f64::min);
    between_insides(one, other).map_or(nearest, |inside| inside.min(nearest))
}

/// Distance of the lines through two segments, where it is that of places inside both.
fn between_insides(one: [Vector3<f64>; 2], other: [Vector3<f64>; 2]) -> Option<f64> {
    let [first, second] = [one, other].map(|ends| ends[1] - ends[0]);
    let normal = first.cross(&second);
    let squared = normal.norm_squared();
    // Nearly parallel segments are nearest to each other at an end.
    if squared <= 1e-12 * first.norm_squared() * second.norm_squared() {
        return None;
    }
    let way = other[0] - one[0];
    let shares = [way.cross(&second).dot(&normal) / squared, way.cross(&first).dot(&normal) / squared];
    let are_inside = shares.iter().all(|share| (0.0..=1.0).contains(share));
    are_inside.then(|| way.dot(&normal).abs() / squared.sqrt())
}

fn to_segment(point: Vector3<f64>, segment: [Vector3<f64>; 2]) -> f64 {
    let way = segment[1] - segment[0];
    let squared = way.norm_squared();
    let share = if squared > 0.0 { ((point - segment[0]).dot(&way) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (point - segment[0] - share * way).norm()
}
