use image::{GrayImage, Luma};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Angle, Camera, ImageSize, Length, Pixel};

use super::*;

const SIDE: u32 = 240;

/// Blots on a sphere that is far away, in this direction.
fn brightness(direction: &Vector3<f64>) -> f64 {
    let at = direction * 25.0;
    let cell = at.map(f64::floor);
    (0..8_u32)
        .map(|corner| {
            let corner = Vector3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1).map(f64::from);
            let node = (cell + corner).map(|place| place as i64);
            let mixed = (node.x + 1000 * (node.y + 1000 * node.z)) as u64;
            let level = (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as f64;
            let near = (at - cell - corner).map(|part| 1.0 - part.abs());
            level * near.x * near.y * near.z
        })
        .sum()
}

fn image(camera: &KannalaBrandt, turn: &UnitQuaternion<f64>) -> GrayImage {
    GrayImage::from_fn(SIDE, SIDE, |x, y| {
        let ray = camera.unproject::<Camera>(Pixel { u: x.into(), v: y.into() });
        Luma([ray.map_or(0, |ray| brightness(&(turn * ray.vector())) as u8)])
    })
}

/// Regression: the grid of the first pair served for ever where the axes turned slowly.
#[test]
fn the_grid_follows_axes_that_turn_slowly() {
    let size = ImageSize { width: SIDE, height: SIDE };
    let centre = Pixel { u: 119.5, v: 119.5 };
    let camera = KannalaBrandt::new([70.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(97.0), size).unwrap();
    let left = image(&camera, &UnitQuaternion::identity());
    let mut state = State::default();
    for step in 0..12 {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), f64::to_radians(0.15) * f64::from(step));
        let pair = ImagePair {
            left: &left,
            right: &image(&camera, &turn),
            left_camera: &camera,
            right_camera: &camera,
            left_from_right: Transform::new(turn, Vector3::new(145.0, 0.0, 0.0)),
            pose_sigma: Angle::from_deg(0.0),
            nearest: Length::from_mm(400.0),
            masks: [None; 2],
        };
        let whole = GuidedMatcher { keypoints: 1000, oversampling: Some(1.5) };
        state.find(&pair, (&whole, Density { least: 1.5, most: 1.5 }), [1000, 400]).unwrap();
        let now = state.before.as_ref().expect("tracks");
        assert!(is_near(&now.pose, &pair.left_from_right), "pair {step}: the grid is of another pose");
        assert!(now.tracks.len() > 40, "{}", now.tracks.len());
    }
}
