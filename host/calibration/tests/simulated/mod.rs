//! Pairs of cameras before simulated targets.
#![allow(dead_code, reason = "each test file uses its share")]

pub mod band;
pub mod stage;
#[path = "../../../targets/tests/simulated/mod.rs"]
mod targets;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
pub use targets::*;
use vergence_calibration::StereoView;
use vergence_targets::TargetView;
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Pixel, Right, Transform};

/// A 196° lens of about 600 px/rad on a 2048 x 2048 sensor.
pub fn lens() -> KannalaBrandt {
    let centre = Pixel { u: 1022.0, v: 1025.5 };
    let size = ImageSize { width: 2048, height: 2048 };
    KannalaBrandt::new([600.0, 6.0, -2.4, 0.6, -0.12], 1.0004, centre, Angle::from_deg(98.0), size).unwrap()
}

/// Another of the kind.
pub fn other_lens() -> KannalaBrandt {
    let centre = Pixel { u: 1026.3, v: 1020.1 };
    let size = ImageSize { width: 2048, height: 2048 };
    KannalaBrandt::new([603.0, 4.5, -1.8, 0.4, -0.1], 0.9996, centre, Angle::from_deg(98.0), size).unwrap()
}

/// A pair turned outwards by `separation_deg`, about 145 mm apart.
pub fn pair_pose(separation_deg: f64) -> Transform<Left, Right> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.006, separation_deg.to_radians(), -0.004));
    // The baseline is orthogonal to the bisector of the two optical axes.
    let half = 0.5 * separation_deg.to_radians();
    Transform::new(rotation, Vector3::new(145.0 * half.cos(), 1.5, -145.0 * half.sin()))
}

/// A pair of cameras and the noise of their corners.
pub struct Pair {
    pub left: KannalaBrandt,
    pub right: KannalaBrandt,
    pub left_from_right: Transform<Left, Right>,
    pub noise_px: f64,
}

impl Pair {
    pub fn see(&self, name: String, left_from_target: &Isometry3<f64>, dice: &mut Dice) -> StereoView {
        let right_from_target = self.left_from_right.inverse().isometry() * left_from_target;
        StereoView {
            name,
            left: photograph(&self.left, left_from_target, self.noise_px, dice),
            right: photograph(&self.right, &right_from_target, self.noise_px, dice),
        }
    }

    /// `count` targets in the field that both cameras share, at least half of each seen by either.
    pub fn views(&self, count: usize, dice: &mut Dice) -> Vec<StereoView> {
        let half = 0.5 * self.left_from_right.rotation().angle();
        // The direction between the optical axes, from the middle of the baseline.
        let forward = self.left_from_right.rotation().powf(0.5) * Vector3::z();
        let middle = self.left_from_right.origin().mm() * 0.5;
        let spread = (98f64.to_radians() - half).clamp(0.35, 0.9);
        let mut views = Vec::new();
        while views.len() < count {
            let direction = UnitQuaternion::from_scaled_axis(dice.cube(spread)) * forward;
            let centre = middle + direction * dice.between(280.0, 650.0);
            let target = facing_target(dice, centre, 40.0);
            let view = self.see(format!("view {}", views.len() + 1), &target, dice);
            let enough = (COLUMNS * ROWS) as usize / 2;
            if view.left.corners.len() >= enough && view.right.corners.len() >= enough {
                views.push(view);
            }
        }
        views
    }
}

/// Photographs of targets all over the field of one camera, for its own calibration.
pub fn own_views(camera: &KannalaBrandt, count: usize, noise_px: f64, dice: &mut Dice) -> Vec<TargetView> {
    let mut views = Vec::new();
    while views.len() < count {
        let (theta, phi) = (dice.between(0.0, 92.0).to_radians(), dice.between(0.0, std::f64::consts::TAU));
        let direction = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let range = dice.between(180.0, 400.0);
        let target = facing_target(dice, direction * range, 45.0);
        let view = photograph(camera, &target, noise_px, dice);
        if view.corners.len() >= 20 {
            views.push(view);
        }
    }
    views
}

/// The rotation between two poses in degrees, and the distance of their origins in millimetres.
pub fn apart(a: &Transform<Left, Right>, b: &Transform<Left, Right>) -> (f64, f64) {
    let rotation = a.rotation().angle_to(&b.rotation()).to_degrees();
    (rotation, (a.origin().mm() - b.origin().mm()).norm())
}

/// From `truth` to `estimate`, in the local coordinates of the covariances.
pub fn error(estimate: &Transform<Left, Right>, truth: &Transform<Left, Right>) -> nalgebra::Vector6<f64> {
    let turn = (estimate.rotation() * truth.rotation().inverse()).scaled_axis();
    let shift = estimate.origin().mm() - truth.origin().mm();
    nalgebra::Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
