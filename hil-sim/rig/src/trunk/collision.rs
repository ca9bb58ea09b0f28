//! Links that touch: each a straight rod with round ends.

use nalgebra::{Isometry3, Point3};
use vergence_rig::linkage::Loop;

use super::JOINTS;

/// Two links that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// The links, each by the number of the joint at its beginning, in the order of the loop.
    pub links: [usize; 2],
    /// How deep one is in the other, in millimetres.
    pub depth_mm: f64,
}

/// All pairs of links that touch and are not neighbours: links that meet in a joint share its bearing and always touch.
pub(super) fn find(linkage: &Loop<JOINTS>, angles: &[f64; JOINTS], radius: f64) -> Vec<Collision> {
    let mut places = Vec::with_capacity(JOINTS);
    let mut pose = Isometry3::identity();
    for (joint, angle) in linkage.joints().iter().zip(angles) {
        pose *= joint.before_from_after(*angle);
        places.push(Point3::from(pose.translation.vector));
    }
    let rod = |link: usize| [places[link], places[(link + 1) % JOINTS]];
    let mut found = Vec::new();
    for first in 0..JOINTS {
        for second in first + 2..JOINTS {
            if first == 0 && second == JOINTS - 1 {
                continue;
            }
            let depth_mm = 2.0 * radius - apart(rod(first), rod(second));
            if depth_mm > 0.0 {
                found.push(Collision { links: [first, second], depth_mm });
            }
        }
    }
    found
}

/// Distance of two segments (C. Ericson, *Real-Time Collision Detection*, 2005, §5.1.9).
fn apart([p1, q1]: [Point3<f64>; 2], [p2, q2]: [Point3<f64>; 2]) -> f64 {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let share = |over: f64, by: f64| if by > 1e-12 { (over / by).clamp(0.0, 1.0) } else { 0.0 };
    let mut s = share(b * f - c * e, a * e - b * b);
    let mut t = if e > 1e-12 { (b * s + f) / e } else { 0.0 };
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = share(b * t - c, a);
    }
    ((p1 + d1 * s) - (p2 + d2 * t)).norm()
}
