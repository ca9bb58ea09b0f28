//! Twists: infinitesimal rigid motions `[ω, v]`, ω in radians about the origin's axes and v in millimetres.
//!
//! K. Lynch and F. Park, *Modern Robotics*, 2017, §3.3.2.

use nalgebra::{Isometry3, SVector, Unit, Vector3};
use vergence_rig::Screw;

use crate::reprojection::POSE;

pub(crate) type Twist = SVector<f64, POSE>;

fn twist(omega: Vector3<f64>, v: Vector3<f64>) -> Twist {
    Twist::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
}

fn parts(twist: &Twist) -> (Vector3<f64>, Vector3<f64>) {
    (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned())
}

/// A rotation about the line through `point` along `omega`.
pub(crate) fn turn(omega: Vector3<f64>, point: Vector3<f64>) -> Twist {
    twist(omega, point.cross(&omega))
}

pub(crate) fn slide(v: Vector3<f64>) -> Twist {
    twist(Vector3::zeros(), v)
}

/// The twist of a screw by a unit amount.
pub(crate) fn of_screw(screw: &Screw) -> Twist {
    match screw {
        Screw::Slide { along } => slide(along.into_inner()),
        Screw::Turn { about, through } => turn(about.into_inner(), through.mm()),
    }
}

/// `motion` seen after `pose`: the adjoint Ad(pose).
pub(crate) fn carried(pose: &Isometry3<f64>, motion: &Twist) -> Twist {
    let (omega, v) = parts(motion);
    let omega = pose.rotation * omega;
    twist(omega, pose.rotation * v + pose.translation.vector.cross(&omega))
}

/// The local coordinates `[ω, δ]` of the move of `pose` by `motion`.
pub(crate) fn as_move(pose: &Isometry3<f64>, motion: &Twist) -> Twist {
    let (omega, v) = parts(motion);
    twist(omega, v + omega.cross(&pose.translation.vector))
}

/// The twist of the move `[ω, δ]` of `pose`.
pub(crate) fn of_move(pose: &Isometry3<f64>, step: &Twist) -> Twist {
    let (omega, delta) = parts(step);
    twist(omega, delta - omega.cross(&pose.translation.vector))
}

/// Two unit vectors orthogonal to `direction` and to each other.
pub(crate) fn across(direction: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let first = direction.cross(&Vector3::ith(direction.iamin(), 1.0)).normalize();
    [first, direction.cross(&first)]
}
