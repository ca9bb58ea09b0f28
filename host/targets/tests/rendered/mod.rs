//! Targets with labelled corners in rendered fisheye images, and how well they were found.
#![allow(dead_code, reason = "each test file uses its share")]

use image::{DynamicImage, GrayImage};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use vergence_scene::{Optics, Scene, Sheet, Target, View, render};
use vergence_targets::{DetectedCorner, SearchedImage, TargetKind, see, see_from};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform, World};

pub fn fisheye(side: u32) -> KannalaBrandt {
    let scale = f64::from(side) / 1280.0;
    let middle = 0.5 * (f64::from(side) - 1.0);
    let k = [366.0, 4.0, -1.5, 0.4, -0.08].map(|k| k * scale);
    let centre = Pixel { u: middle + 3.0, v: middle - 2.0 };
    KannalaBrandt::new(k, 1.0003, centre, Angle::from_deg(98.0), ImageSize { width: side, height: side }).unwrap()
}

pub fn optics(blur_px: f64, noise: f64) -> Optics {
    Optics { samples: 2, edge_samples: 40, blur_px, read_noise: noise, shot_noise: noise, ..Optics::default() }
}

/// A look by what the search found before, with the lens or without it, gives what a look from nothing gives.
pub fn assert_searched_once(image: &GrayImage, target: &TargetKind, camera: &KannalaBrandt) {
    let searched = SearchedImage::default();
    for hint in [None, Some(camera)] {
        assert_eq!(see_from(&searched, image, target, hint, ""), see(image, target, hint, ""));
    }
}

/// The middle of the sheet, `theta` from the axis towards `azimuth` (0° right, 90° down).
#[derive(Clone, Copy)]
pub struct Pose {
    pub theta_deg: f64,
    pub azimuth_deg: f64,
    pub roll_deg: f64,
    pub tilt_deg: f64,
    pub distance_mm: f64,
}

impl Pose {
    pub fn camera_from_target(self, sheet: &Sheet) -> Transform<Camera, Target> {
        let [theta, azimuth, roll, tilt] =
            [self.theta_deg, self.azimuth_deg, self.roll_deg, self.tilt_deg].map(f64::to_radians);
        let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        let towards = turn(Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0), theta);
        let rotation = towards * turn(Vector3::z(), roll) * turn(Vector3::y(), tilt);
        sheet.placed(rotation, towards * Vector3::z() * self.distance_mm)
    }
}

pub fn photograph(scene: &Scene, camera: &KannalaBrandt, optics: &Optics, seed: u64) -> GrayImage {
    let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    DynamicImage::from(render(&View { scene, camera, world_from_camera, optics }, seed).image).to_luma8()
}

/// The scene with the unprinted back of a board 10 mm before the left half of a target, turned so that its edge cuts through
/// squares.
fn half_hidden(scene: Scene, place: &Transform<Camera, Target>) -> Scene {
    let board = Target { columns: 9, rows: 9, square: Length::from_mm(24.0) };
    let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.2);
    let cover = place.isometry() * Isometry3::from_parts(Vector3::new(-50.0, 80.0, -10.0).into(), turn);
    scene.with_target(board, board.placed::<World>(cover.rotation, cover.translation.vector))
}

/// Pictures of a sheet that is half hidden, one near the axis and one far from it: the angle, the place of the sheet, and the picture.
pub fn half_hidden_shots(
    sheet: Sheet,
    camera: &KannalaBrandt,
) -> impl Iterator<Item = (f64, Transform<Camera, Target>, GrayImage)> {
    [(10.0, 1), (75.0, 2)].into_iter().map(move |(theta_deg, seed)| {
        let pose = Pose { theta_deg, azimuth_deg: 40.0, roll_deg: 30.0, tilt_deg: 10.0, distance_mm: 190.0 };
        let place = pose.camera_from_target(&sheet);
        let scene = half_hidden(Scene::studio().with_target(sheet, place.renamed()), &place);
        (theta_deg, place, photograph(&scene, camera, &optics(0.7, 2.0), seed))
    })
}

/// A target before a camera.
pub struct Truth<'a> {
    /// Number of corners, and where each is on the target in millimetres.
    pub corners: (u32, &'a dyn Fn(u32) -> [f64; 2]),
    pub place: Transform<Camera, Target>,
    pub camera: &'a KannalaBrandt,
}

/// Share of the corners in sight that are found, root mean square error per axis, largest error, largest angle found.
pub struct Tally {
    pub found: usize,
    pub in_sight: usize,
    pub rms_px: f64,
    pub worst_px: f64,
    pub farthest_deg: f64,
}

impl Truth<'_> {
    /// Pixel of a corner, and its angle from the axis, if the sensor sees it.
    pub fn corner(&self, index: u32) -> Option<(Pixel, f64)> {
        let [x, y] = (self.corners.1)(index);
        let at = self.place * Point::<Target>::from_mm(Vector3::new(x, y, 0.0));
        let pixel = self.camera.project_point(&at).ok().filter(|pixel| self.camera.on_sensor(*pixel))?;
        Some((pixel, self.camera.unproject::<Camera>(pixel).ok()?.angle_to_axis().deg()))
    }

    /// The angles from the axis of all corners in sight.
    pub fn in_sight(&self) -> Vec<f64> {
        (0..self.corners.0).filter_map(|index| Some(self.corner(index)?.1)).collect()
    }

    /// How far each corner is from where it truly is, in pixels, and its angle from the axis. A corner that is not in sight is
    /// infinitely far off.
    pub fn errors(&self, corners: &[DetectedCorner]) -> Vec<(f64, f64)> {
        let error = |corner: &DetectedCorner| {
            let Some((at, angle)) = self.corner(corner.index) else { return (f64::INFINITY, 0.0) };
            ((corner.pixel.u - at.u).hypot(corner.pixel.v - at.v), angle)
        };
        corners.iter().map(error).collect()
    }

    pub fn tally(&self, corners: &[DetectedCorner]) -> Tally {
        let errors = self.errors(corners);
        let squares: f64 = errors.iter().map(|(off, _)| 0.5 * off * off).sum();
        Tally {
            found: corners.len(),
            in_sight: self.in_sight().len(),
            rms_px: (squares / corners.len() as f64).sqrt(),
            worst_px: errors.iter().map(|(off, _)| *off).fold(0.0, f64::max),
            farthest_deg: errors.iter().map(|(_, angle)| *angle).fold(0.0, f64::max),
        }
    }
}

/// Corners in sight, corners found and their squared errors, in rings about the axis.
#[derive(Default)]
pub struct ByAngle([(usize, usize, f64); 4]);

impl ByAngle {
    const UP_TO_DEG: [f64; 4] = [40.0, 70.0, 90.0, 98.0];

    fn ring(angle_deg: f64) -> usize {
        Self::UP_TO_DEG.iter().take(3).filter(|end| angle_deg >= **end).count()
    }

    pub fn add(&mut self, in_sight: &[f64], errors: &[(f64, f64)]) {
        for angle in in_sight {
            self.0[Self::ring(*angle)].0 += 1;
        }
        for (off, angle) in errors {
            let ring = &mut self.0[Self::ring(*angle)];
            (ring.1, ring.2) = (ring.1 + 1, ring.2 + 0.5 * off * off);
        }
    }

    /// Prints a line for each ring, and returns the found share and the root mean square error per axis of all.
    pub fn print(&self, what: &str) -> (f64, f64) {
        for ((in_sight, found, squares), end) in self.0.iter().zip(Self::UP_TO_DEG) {
            let share = 100.0 * *found as f64 / *in_sight as f64;
            let rms = (squares / *found as f64).sqrt();
            println!("{what} to {end}°: {found} of {in_sight} corners ({share:.0} %), rms {rms:.3} px");
        }
        let in_sight: usize = self.0.iter().map(|ring| ring.0).sum();
        let found: usize = self.0.iter().map(|ring| ring.1).sum();
        let squares: f64 = self.0.iter().map(|ring| ring.2).sum();
        (found as f64 / in_sight as f64, (squares / found as f64).sqrt())
    }
}
