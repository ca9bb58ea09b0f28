//! Cameras that the tests share.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Photograph, Scene, View, render};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Pixel, Transform, World};

/// A lens of 196° whose field spans most of a square image of `side` pixels, off-centre by a fraction of a pixel.
pub fn fisheye(side: u32) -> KannalaBrandt {
    let scale = f64::from(side) / 1280.0;
    let middle = 0.5 * f64::from(side) - 0.5;
    let k = [374.0 * scale, -6.0 * scale, 0.5 * scale, 0.0, 0.0];
    let size = ImageSize { width: side, height: side };
    KannalaBrandt::new(k, 1.001, Pixel { u: middle + 0.3, v: middle - 0.2 }, Angle::from_deg(98.0), size).unwrap()
}

/// A pose at `x`, `y`, `z` mm, turned right by `yaw_deg`.
pub fn pose(position_mm: [f64; 3], yaw_deg: f64) -> Transform<World, Camera> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw_deg.to_radians());
    Transform::new(turn, Vector3::from(position_mm))
}

/// Renders `scene` from `world_from_camera`.
pub fn photograph(
    scene: &Scene,
    camera: &KannalaBrandt,
    world_from_camera: Transform<World, Camera>,
    optics: &Optics,
    seed: u64,
) -> Photograph {
    render(&View { scene, camera, world_from_camera, optics }, seed)
}
