//! Targets before simulated cameras: projected corners with Gaussian noise.
#![allow(dead_code, reason = "each test file uses its share")]

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Camera, KannalaBrandt, Pixel, Point};

/// Inner corners along x and y, and the square in millimetres, of the targets of these tests.
pub const COLUMNS: u32 = 9;
pub const ROWS: u32 = 6;
pub const SQUARE_MM: f64 = 25.0;

/// The standard normal and other distributions, from a seed.
pub struct Dice(Pcg64Mcg);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.random::<f64>()).cos()
    }

    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }

    /// Uniform in the cube of half side `half`.
    pub fn cube(&mut self, half: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-half, half))
    }
}

/// All corners of the target in target coordinates.
pub fn target_corners() -> Vec<[f64; 2]> {
    (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| [column, row].map(|n| f64::from(n) * SQUARE_MM))).collect()
}

/// A target whose centre is at `centre`, facing the origin but for a tilt, with any turn in its plane.
pub fn facing_target(dice: &mut Dice, centre: Vector3<f64>, largest_tilt_deg: f64) -> Isometry3<f64> {
    let away = centre.normalize();
    let side = Vector3::y().cross(&away).normalize();
    let facing = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[side, away.cross(&side), away]));
    let tilt = dice.between(8.0, largest_tilt_deg).to_radians();
    let towards = dice.between(0.0, std::f64::consts::TAU);
    let tilted = Rotation3::from_scaled_axis(Vector3::new(towards.cos(), towards.sin(), 0.0) * tilt);
    let turned = Rotation3::from_scaled_axis(Vector3::z() * dice.between(-3.0, 3.0));
    let rotation = UnitQuaternion::from_rotation_matrix(&(facing * tilted * turned));
    let middle = Vector3::new(f64::from(COLUMNS - 1), f64::from(ROWS - 1), 0.0) * (0.5 * SQUARE_MM);
    Isometry3::from_parts(Translation3::from(centre - rotation * middle), rotation)
}

/// The corners that `camera` sees of the target at `camera_from_target`, off by Gaussian noise.
pub fn photograph(
    camera: &KannalaBrandt,
    camera_from_target: &Isometry3<f64>,
    noise_px: f64,
    dice: &mut Dice,
) -> TargetView {
    let see = |target_mm: [f64; 2]| {
        let point = camera_from_target * Point3::new(target_mm[0], target_mm[1], 0.0);
        let exact = camera.project_point(&Point::<Camera>::from_mm(point.coords)).ok()?;
        let pixel = Pixel { u: exact.u + noise_px * dice.normal(), v: exact.v + noise_px * dice.normal() };
        (camera.on_sensor(pixel) && camera.unproject::<Camera>(pixel).is_ok()).then_some(Corner::new(target_mm, pixel))
    };
    TargetView { name: String::new(), corners: target_corners().into_iter().filter_map(see).collect() }
}

/// How many seeds a study runs: `few` unless the environment asks for more.
pub fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

/// Which seed a study starts at: 0 unless the environment asks for another, so that a long one can be run in parts.
pub fn first_seed() -> u64 {
    std::env::var("VERGENCE_FIRST_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(0)
}
