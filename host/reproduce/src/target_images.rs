//! What the cameras see of the bench's target, small, for the page.

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{LensChoice, Optics, Scene, View, render};
use vergence_vision::{Camera, Transform, World};

use crate::axes::Axes;
use crate::bench::{MODES, bench_with_sensors, scene_target};
use crate::error::ReproduceError;
use crate::measure::DEPTH;

/// Pixels on a side.
const SIDE: u32 = 640;

/// A mode's name and what the left and the right camera see of a target straight ahead, side by side, through such lenses.
///
/// # Errors
/// Where the built-in bench does not read, or a design of a lens cannot be traced.
pub fn target_images(seed: u64, lens: LensChoice) -> Result<Vec<(&'static str, RgbImage)>, ReproduceError> {
    let rig = bench_with_sensors(SIDE)?;
    let lens = lens.in_place_of(&rig.left_camera).map_err(|error| ReproduceError::Rig(error.to_string()))?;
    let picture = |name: &'static str| {
        let values: Vec<f64> = rig.mode(name)?.targets.iter().map(|target| target.value()).collect();
        let left_from_right = rig.pose_at_values(&values).left_from_right;
        let axes = Axes::of(&left_from_right);
        let place = scene_target().placed(axes.rotation(), axes.middle + axes.forward * DEPTH.mm());
        let scene = Scene::target_in_studio(scene_target(), place);
        let optics = Optics::default();
        let photograph = |world_from_camera: Transform<World, Camera>| {
            render(&View { scene: &scene, camera: &lens, world_from_camera, optics: &optics }, seed).image
        };
        let left = photograph(Transform::new(UnitQuaternion::identity(), Vector3::zeros()));
        let right = photograph(left_from_right.renamed());
        let mut both = RgbImage::new(2 * SIDE, SIDE);
        image::imageops::replace(&mut both, &left, 0, 0);
        image::imageops::replace(&mut both, &right, i64::from(SIDE), 0);
        Some((name, both))
    };
    Ok(MODES.into_iter().filter_map(picture).collect())
}
