//! The furnished room of the simulator: plain walls, fine texture, thin things, occlusion.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod common;

use common::{BASELINE_MM, equidistant, median, triangulated_range};
use image::{DynamicImage, GrayImage};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::{GuidedMatcher, ImagePair, Matcher};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Angle, Camera, Left, Length, Right, Transform, UnitRay, World};

/// Relative depth errors of the matches between cameras of `side` pixels whose axes are `separation` apart, and the
/// part of all depths that is more than 10 % wrong. Only points up to 1.5 m are in the former.
fn depth_errors(side: u32, separation: Angle) -> (Vec<f64>, f64) {
    let (scene, camera, optics) = (Scene::room(), equidistant(side), Optics::default());
    let pose = |x: f64, yaw: f64| -> Transform<World, Camera> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw);
        Transform::new(turn, Vector3::new(x, 0.0, 0.0))
    };
    let half = separation.rad() / 2.0;
    let (left_pose, right_pose) = (pose(-BASELINE_MM / 2.0, -half), pose(BASELINE_MM / 2.0, half));
    let photograph = |world_from_camera, seed| -> GrayImage {
        let view = View { scene: &scene, camera: &camera, world_from_camera, optics: &optics };
        DynamicImage::ImageRgb8(render(&view, seed).image).to_luma8()
    };
    let (left, right) = (photograph(left_pose, 1), photograph(right_pose, 2));
    let world_from_left: Transform<World, Left> = left_pose.renamed();
    let left_from_right = world_from_left.inverse() * right_pose.renamed::<World, Right>();
    let pair = ImagePair {
        left: &left,
        right: &right,
        left_camera: &camera,
        right_camera: &camera,
        left_from_right,
        pose_sigma: Angle::from_deg(0.0),
        nearest: Length::from_mm(300.0),
        masks: [None; 2],
    };
    let matches = GuidedMatcher::default().find(&pair).unwrap();
    let judged: Vec<(f64, f64)> = matches
        .pairs
        .iter()
        .map(|found| {
            let left_ray: UnitRay<Left> = camera.unproject(found.left).unwrap();
            let right_ray: UnitRay<Right> = camera.unproject(found.right).unwrap();
            let truth = scene.cast(&world_from_left.origin(), &(world_from_left * left_ray)).unwrap().range.mm();
            let depth = triangulated_range(&left_ray, &(left_from_right * right_ray), &left_from_right.inverse());
            (truth, (depth / truth - 1.0).abs())
        })
        .collect();
    let wrong = judged.iter().filter(|(_, error)| *error > 0.1).count() as f64 / judged.len() as f64;
    (judged.iter().filter(|(range, _)| *range < 1500.0).map(|(_, error)| *error).collect(), wrong)
}

#[test]
fn parallel_cameras_of_640_pixels() {
    let (near, wrong) = depth_errors(640, Angle::from_deg(0.0));
    assert!(near.len() >= 400, "{} matches up to 1.5 m", near.len());
    assert!(wrong < 0.025, "{wrong:.4} of the depths are wrong");
    assert!(median(near) < 0.006);
}

#[test]
fn cameras_of_1280_pixels_120_degrees_apart() {
    let (near, wrong) = depth_errors(1280, Angle::from_deg(120.0));
    assert!(near.len() >= 400, "{} matches up to 1.5 m", near.len());
    assert!(wrong < 0.02, "{wrong:.4} of the depths are wrong");
    assert!(median(near) < 0.002);
}
