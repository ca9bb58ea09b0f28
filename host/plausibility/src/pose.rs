//! Checks of a rig and of the relative pose of its cameras.

use nalgebra::Vector3;
use vergence_vision::{Left, Length, Right, Transform};

use crate::Implausible;

/// The largest distance of two cameras.
const WIDEST: Length = Length::from_mm(10_000.0);
/// How much of the baseline points to the left where cameras are swapped: cameras above each other have about nothing there.
const CLEARLY_LEFT: f64 = 0.5;

/// Cameras of one rig stand within 10 m of each other.
///
/// # Errors
/// [`Implausible::Input`].
pub fn cameras_are_near(left_from_right: &Transform<Left, Right>) -> Result<(), Implausible> {
    let metres = left_from_right.origin().mm().norm() * 1e-3;
    if metres <= WIDEST.mm() * 1e-3 {
        return Ok(());
    }
    Err(Implausible::Input(format!(
        "the cameras stand {metres:.1} m apart, and those of a rig at most {:.0} m: is a length in the wrong unit, such as m for mm?",
        WIDEST.mm() * 1e-3
    )))
}

/// A right camera stands right of the left one, seen along the direction between both axes.
///
/// # Errors
/// [`Implausible::Result`].
pub fn right_is_on_the_right(left_from_right: &Transform<Left, Right>) -> Result<(), Implausible> {
    let turn = left_from_right.rotation();
    let middle = |axis: Vector3<f64>| (axis + turn * axis).try_normalize(1e-6);
    let (Some(forward), Some(down)) = (middle(Vector3::z()), middle(Vector3::y())) else { return Ok(()) };
    let to_right = down.cross(&forward);
    let baseline = left_from_right.origin().mm();
    let across = baseline.dot(&to_right);
    if across >= -CLEARLY_LEFT * baseline.norm() {
        return Ok(());
    }
    Err(Implausible::Result(format!(
        "the right camera stands {:.1} mm to the left of the left one: are left and right swapped?",
        -across
    )))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn placed(separation_deg: f64, origin: [f64; 3]) -> Transform<Left, Right> {
        let turn = UnitQuaternion::from_euler_angles(0.0, separation_deg.to_radians(), 0.0);
        Transform::new(turn, origin.into())
    }

    #[test]
    fn only_a_right_camera_on_the_left_is_refused() {
        // Herbivore: the left camera looks 60 degrees to the left, and has the right one at 60 degrees to its right and behind.
        let (sine, cosine) = 60f64.to_radians().sin_cos();
        for (separation, origin) in [
            (0.0, [145.0, 0.0, 0.0]),
            (120.0, [145.0 * cosine, 0.0, -145.0 * sine]),
            (0.0, [0.0, 145.0, 0.0]),
            (0.0, [-20.0, -145.0, 10.0]),
            (0.0, [-20.0, 0.0, 145.0]),
        ] {
            assert!(right_is_on_the_right(&placed(separation, origin)).is_ok(), "{separation} {origin:?}");
        }
        let swapped = placed(-4.0, [-145.0, 3.0, 2.0]);
        assert!(right_is_on_the_right(&swapped).is_err_and(|found| found.to_string().contains("swapped?")));
        let herbivore = placed(120.0, [145.0 * cosine, 0.0, -145.0 * sine]).inverse();
        let mirrored = Transform::<Left, Right>::new(herbivore.rotation(), herbivore.origin().mm());
        assert!(right_is_on_the_right(&mirrored).is_err());
    }
}
