//! A pair of images of the simulated room, and the truth for every pixel.

use std::path::Path;

use image::imageops::grayscale;
use image::{GrayImage, RgbImage};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_camera::read_image;
use vergence_scene::{Optics, Scene, View, render};
use vergence_sim::Random;
use vergence_vision::{Angle, Camera, KannalaBrandt, Left, Length, Pixel, Right, Transform, World};

use crate::error::BenchError;

const BASELINE_MM: f64 = 145.0;

/// A pair of images, the lens of both cameras, and their pose.
pub struct SimulatedPair {
    /// The lens of both cameras.
    pub lens: KannalaBrandt,
    /// The left image.
    pub left: GrayImage,
    /// The right image.
    pub right: GrayImage,
    /// The true pose of the right camera.
    pub left_from_right: Transform<Left, Right>,
    world_from_left: Transform<World, Left>,
    scene: Scene,
}

impl SimulatedPair {
    /// Renders the room through `lens`, with the optical axes `separation` apart; every seed stands at another place. Images
    /// that the folder `renders` has are read from there, and others are written to it.
    ///
    /// # Errors
    /// Where an image cannot be read or written.
    pub fn new(lens: KannalaBrandt, separation: Angle, seed: u64, renders: Option<&Path>) -> Result<Self, BenchError> {
        let (side, scene, stand) = (lens.size().width, Scene::room(), Stand::of(seed));
        let half = separation.rad() / 2.0;
        let world_from_left = stand.camera(-BASELINE_MM / 2.0, -half, stand.mounts[0]);
        let world_from_right = stand.camera(BASELINE_MM / 2.0, half, stand.mounts[1]);
        let photograph = |name: &str, world_from_camera, noise| {
            let kept = renders.map(|folder| folder.join(format!("{seed}-{side}-{:.0}-{name}.png", separation.deg())));
            if let Some(path) = kept.as_deref().filter(|path| path.is_file()) {
                let image = read_image(path).map_err(|error| BenchError::Image(error.to_string()))?;
                return Ok(grayscale(&image));
            }
            let view = View { scene: &scene, camera: &lens, world_from_camera, optics: &Optics::default() };
            let image: RgbImage = render(&view, noise).image;
            if let (Some(folder), Some(path)) = (renders, kept) {
                keep(&image, folder, &path)?;
            }
            Ok::<_, BenchError>(grayscale(&image))
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

    /// Range of the surface that the left camera sees at a pixel, from the left camera.
    pub fn range(&self, left: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.lens.unproject::<Left>(left).ok()?;
        Some(self.scene.cast(&self.world_from_left.origin(), &ray)?.range)
    }
}

/// Place and heading of the rig in the room, and the errors of its mounts.
struct Stand {
    middle: Vector3<f64>,
    heading: f64,
    /// Pitch and roll of both cameras.
    mounts: [[f64; 2]; 2],
}

impl Stand {
    /// Largest distance from the middle of the room, around which half a metre is free.
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

    /// Pose of the camera at `x` on the bench, turned outwards by `yaw`.
    fn camera(&self, x: f64, yaw: f64, [pitch, roll]: [f64; 2]) -> Transform<World, Camera> {
        let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.heading);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch)
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
        Transform::new(heading * turn, self.middle + heading * Vector3::new(x, 0.0, 0.0))
    }
}

/// Writes an image to `path` in `folder`, whole or not at all: a later run reads it.
fn keep(image: &RgbImage, folder: &Path, path: &Path) -> Result<(), BenchError> {
    let failed = |error: &dyn std::fmt::Display| BenchError::Image(format!("cannot write {}: {error}", path.display()));
    std::fs::create_dir_all(folder).map_err(|error| failed(&error))?;
    let file = tempfile::Builder::new().suffix(".png").tempfile_in(folder).map_err(|error| failed(&error))?;
    image.save(file.path()).map_err(|error| failed(&error))?;
    file.persist(path).map_err(|error| failed(&error.error))?;
    Ok(())
}
