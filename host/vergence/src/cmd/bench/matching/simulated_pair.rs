//! Two eyes in the simulated room, and the truth for every pixel.

use std::path::Path;

use image::RgbImage;
use image::imageops::grayscale;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Angle, Camera, KannalaBrandt, Left, Length, Pixel, Right, Transform, World};

use crate::camera::read_image;
use crate::failure::Failure;
use crate::output::{make_folder, write_png};
use crate::rig_file::bench_with_sensors;
use crate::sim::Random;

const BASELINE_MM: f64 = 145.0;

/// Two photographs, the lens that made both, and where they were made.
pub struct SimulatedPair {
    pub lens: KannalaBrandt,
    pub left: image::GrayImage,
    pub right: image::GrayImage,
    pub left_from_right: Transform<Left, Right>,
    world_from_left: Transform<World, Left>,
    scene: Scene,
}

impl SimulatedPair {
    /// Renders it, or reads it from the folder of `renders` where it is kept there. Every seed has a stand of its own.
    ///
    /// # Errors
    /// Where the folder cannot be read or written.
    pub fn new(side: u32, separation: Angle, seed: u64, renders: Option<&Path>) -> Result<Self, Failure> {
        let (lens, scene, stand) = (bench_with_sensors(side)?.left_camera, Scene::room(), Stand::of(seed));
        let half = separation.rad() / 2.0;
        let world_from_left = stand.eye(-BASELINE_MM / 2.0, -half, stand.mounts[0]);
        let world_from_right = stand.eye(BASELINE_MM / 2.0, half, stand.mounts[1]);
        let photograph = |name: &str, world_from_camera, noise| {
            let kept = renders.map(|folder| folder.join(format!("{seed}-{side}-{:.0}-{name}.png", separation.deg())));
            if let Some(path) = kept.as_deref().filter(|path| path.is_file()) {
                return Ok(grayscale(&read_image(path)?));
            }
            let view = View { scene: &scene, camera: &lens, world_from_camera, optics: &Optics::default() };
            let image: RgbImage = render(&view, noise).image;
            if let (Some(folder), Some(path)) = (renders, kept) {
                make_folder(folder)?;
                write_png(&path, &image)?;
            }
            Ok::<_, Failure>(grayscale(&image))
        };
        Ok(Self {
            left: photograph("left", world_from_left, 2 * seed + 1)?,
            right: photograph("right", world_from_right, 2 * seed + 2)?,
            left_from_right: (world_from_left.inverse() * world_from_right).renamed(),
            world_from_left: world_from_left.renamed(),
            lens,
            scene,
        })
    }

    /// Range of what the left eye sees at a pixel, from the left eye.
    pub fn range(&self, left: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.lens.unproject::<Left>(left).ok()?;
        Some(self.scene.cast(&self.world_from_left.origin(), &ray)?.range)
    }
}

/// Where the rig stands in the room, which way it looks, and how its mounts are off.
struct Stand {
    middle: Vector3<f64>,
    heading: f64,
    /// Pitch and roll of both eyes.
    mounts: [[f64; 2]; 2],
}

impl Stand {
    /// Farthest from the middle of the room, whose nearest half metre is free.
    const AWAY_MM: Vector3<f64> = Vector3::new(150.0, 100.0, 150.0);
    const MOST_PITCH: Angle = Angle::from_deg(2.0);
    const MOST_ROLL: Angle = Angle::from_deg(3.0);

    fn of(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut within = |reach: f64| random.between(-reach, reach);
        let heading = within(std::f64::consts::PI);
        let middle = Self::AWAY_MM.map(&mut within);
        let mounts = std::array::from_fn(|_| [within(Self::MOST_PITCH.rad()), within(Self::MOST_ROLL.rad())]);
        Self { middle, heading, mounts }
    }

    /// The eye at `x` on the bench, turned outwards by `yaw`.
    fn eye(&self, x: f64, yaw: f64, [pitch, roll]: [f64; 2]) -> Transform<World, Camera> {
        let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.heading);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch)
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
        Transform::new(heading * turn, self.middle + heading * Vector3::new(x, 0.0, 0.0))
    }
}
