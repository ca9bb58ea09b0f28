//! Where targets stand before the rig.

use nalgebra::UnitQuaternion;
use vergence_scene::Target;
use vergence_sim::Random;
use vergence_vision::{Left, Right, Transform};

use crate::axes::Axes;
use crate::bench::scene_target;

/// Centres of targets lie within so many degrees of straight ahead, to the side and up or down.
const ASIDE_DEG: [f64; 2] = [10.0, 22.0];

/// A group of targets: one straight ahead, the others towards the corners of the field.
pub struct Spread {
    /// How many.
    pub targets: usize,
    /// Their depth lies between these.
    pub depth_mm: [f64; 2],
    /// They are tilted up to so far about each axis.
    pub tilt_rad: f64,
}

/// Targets before the rig, in the left frame.
pub fn targets(
    left_from_right: &Transform<Left, Right>,
    spread: &Spread,
    random: &mut Random,
) -> Vec<Transform<Left, Target>> {
    let axes = Axes::of(left_from_right);
    (0..spread.targets)
        .map(|index| {
            let mut aside = |sign: f64| sign * random.between(ASIDE_DEG[0], ASIDE_DEG[1]).to_radians().tan();
            // The four quarters of the field, one after the other.
            let (x, y) = match index {
                0 => (0.0, 0.0),
                quarter => (
                    aside(if quarter % 2 == 0 { 1.0 } else { -1.0 }),
                    aside(if (quarter - 1) % 4 > 1 { 1.0 } else { -1.0 }),
                ),
            };
            let [near, far] = spread.depth_mm;
            let depth = if far > near { random.between(near, far) } else { near };
            let centre = axes.middle + (axes.forward + axes.right * x + axes.down * y) * depth;
            let mut tilt = || random.between(-spread.tilt_rad, spread.tilt_rad);
            let tilt = UnitQuaternion::from_euler_angles(tilt(), tilt(), tilt());
            scene_target().placed(axes.rotation() * tilt, centre)
        })
        .collect()
}
