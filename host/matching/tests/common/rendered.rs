//! Pairs rendered by the simulator in the bench's modes, with the exact range of every pixel of both images.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]
#![allow(dead_code, reason = "each test binary uses its part")]

use image::{DynamicImage, GrayImage};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::ImagePair;
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Left, Length, Pixel, Point, Right, Transform, World};

/// The bench's baseline in both modes.
pub const BASELINE_MM: f64 = 145.0;
/// Largest relative difference of the true and the seen range of a point that is not hidden.
const SAME_POINT: f64 = 0.02;

/// The bench in the middle of the room, in its modes.
pub const HUMAN: Place =
    Place { name: "room, human", scene: Scene::room, at: [0.0, 0.0, 0.0], heading_deg: 0.0, separation_deg: 0.0 };
pub const HERBIVORE: Place = Place { name: "room, herbivore", separation_deg: 120.0, ..HUMAN };
/// The same in the corridor.
pub const CORRIDOR_HUMAN: Place = Place { name: "corridor, human", scene: Scene::corridor, ..HUMAN };
pub const CORRIDOR_HERBIVORE: Place = Place { name: "corridor, herbivore", scene: Scene::corridor, ..HERBIVORE };

/// Where the bench stands, and how its cameras are turned.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub name: &'static str,
    pub scene: fn() -> Scene,
    /// The middle of the baseline in the scene, in millimetres.
    pub at: [f64; 3],
    /// Turn about the vertical.
    pub heading_deg: f64,
    /// Angle between the optical axes.
    pub separation_deg: f64,
}

/// A pair of images with the truth.
pub struct Rendered {
    pub camera: KannalaBrandt,
    /// The true pose.
    pub left_from_right: Transform<Left, Right>,
    pub grey: [GrayImage; 2],
    /// True ranges of all pixels in millimetres, by rows; NaN where there is none.
    pub ranges: [Vec<f32>; 2],
}

/// The bench's lens on a sensor of `side` pixels.
pub fn lens(side: u32) -> KannalaBrandt {
    let f = 366.0 * f64::from(side) / 1280.0;
    let centre = f64::from(side) / 2.0 - 0.5;
    let k = [f, 0.01 * f, -0.004 * f, 0.001 * f, -0.0002 * f];
    let size = ImageSize { width: side, height: side };
    KannalaBrandt::new(k, 1.0, Pixel { u: centre, v: centre }, Angle::from_deg(97.975), size).unwrap()
}

impl Place {
    /// The poses of both cameras in the scene.
    fn poses(&self) -> [Transform<World, Camera>; 2] {
        let turned = |deg: f64| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), deg.to_radians());
        [-0.5, 0.5].map(|side| {
            let at = Vector3::from(self.at) + turned(self.heading_deg) * Vector3::new(side * BASELINE_MM, 0.0, 0.0);
            Transform::new(turned(self.heading_deg + side * self.separation_deg), at)
        })
    }

    /// Renders images of `side` pixels; the noise follows `seed`.
    pub fn rendered(&self, side: u32, seed: u64) -> Rendered {
        self.rendered_by(lens(side), seed)
    }

    /// Renders the images of two cameras with this lens; the noise follows `seed`.
    pub fn rendered_by(&self, camera: KannalaBrandt, seed: u64) -> Rendered {
        let (scene, optics, poses) = ((self.scene)(), Optics::default(), self.poses());
        let photographs = [0, 1].map(|i| {
            let view = View { scene: &scene, camera: &camera, world_from_camera: poses[i], optics: &optics };
            render(&view, 2 * seed + i as u64)
        });
        Rendered {
            camera,
            left_from_right: self.left_from_right(),
            grey: photographs.each_ref().map(|it| DynamicImage::ImageRgb8(it.image.clone()).to_luma8()),
            ranges: photographs.map(|it| it.range.as_mm().to_vec()),
        }
    }

    /// The pose of the left camera in the scene.
    pub fn world_from_left(&self) -> Transform<World, Left> {
        let [left, _] = self.poses();
        left.renamed()
    }

    pub fn left_from_right(&self) -> Transform<Left, Right> {
        let [left, right] = self.poses();
        left.renamed::<World, Left>().inverse() * right.renamed::<World, Right>()
    }
}

impl Rendered {
    /// The pair with a stated pose whose right camera is turned by `off` in its own axes, in radians.
    pub fn pair(&self, off: Vector3<f64>) -> ImagePair<'_> {
        let turn = self.left_from_right.rotation() * UnitQuaternion::from_scaled_axis(off);
        ImagePair {
            left: &self.grey[0],
            right: &self.grey[1],
            left_camera: &self.camera,
            right_camera: &self.camera,
            left_from_right: Transform::new(turn, self.left_from_right.origin().mm()),
            pose_sigma: Angle::from_deg(0.0),
            nearest: Length::from_mm(200.0),
            masks: [None; 2],
        }
    }

    /// The point that a left pixel shows.
    pub fn point(&self, x: u32, y: u32) -> Option<Point<Left>> {
        let range = f64::from(self.ranges[0][(y * self.camera.size().width + x) as usize]);
        let ray = self.camera.unproject::<Left>(Pixel { u: x.into(), v: y.into() }).ok()?;
        range.is_finite().then(|| ray.at(range))
    }

    /// Whether the right camera sees the point of a left pixel: nothing stands before it.
    pub fn is_seen_by_right(&self, point: &Point<Left>) -> bool {
        let in_right = self.left_from_right.inverse() * *point;
        let Ok(pixel) = self.camera.project_point(&in_right) else { return false };
        if !self.camera.on_sensor(pixel) {
            return false;
        }
        let side = self.camera.size().width as usize;
        let (u, v) = (pixel.u.round() as usize, pixel.v.round() as usize);
        let seen = f64::from(self.ranges[1][v.min(side - 1) * side + u.min(side - 1)]);
        seen >= in_right.mm().norm() * (1.0 - SAME_POINT)
    }

    /// For each left pixel the distance in pixels (of eight neighbours) to the nearest pixel beyond a jump of the
    /// range, up to `most`.
    pub fn distances_from_edges(&self, most: u8) -> Vec<u8> {
        let side = self.camera.size().width as usize;
        let ranges = &self.ranges[0];
        let jump = |one: usize, other: usize| {
            let (p, q) = (f64::from(ranges[one]), f64::from(ranges[other]));
            // Inverse ranges are linear over planes; a jump is a difference in parallax of a pixel and more.
            (1.0 / p - 1.0 / q).abs() * BASELINE_MM * self.camera.k()[0] > 1.5
        };
        let mut distances = vec![most; ranges.len()];
        for index in 0..ranges.len() {
            let (x, y) = (index % side, index / side);
            if x + 1 < side && jump(index, index + 1) {
                (distances[index], distances[index + 1]) = (0, 0);
            }
            if y + 1 < side && jump(index, index + side) {
                (distances[index], distances[index + side]) = (0, 0);
            }
        }
        for round in 0..most {
            let before = distances.clone();
            for (index, distance) in before.iter().enumerate() {
                let (x, y) = (index % side, index / side);
                if *distance == round {
                    for j in y.saturating_sub(1)..(y + 2).min(side) {
                        for i in x.saturating_sub(1)..(x + 2).min(side) {
                            distances[j * side + i] = distances[j * side + i].min(round + 1);
                        }
                    }
                }
            }
        }
        distances
    }
}
