//! Targets before simulated cameras: projected corners with Gaussian noise.
#![allow(dead_code, reason = "each test file uses its share")]

pub mod stage;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_calibration::{Corner, StereoView, TargetView};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Left, Pixel, Point, Right, Transform};

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

/// How many seeds a study runs: `few` unless the environment asks for more.
pub fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

/// Which seed a study starts at: 0 unless the environment asks for another, so that a long one can be run in parts.
pub fn first_seed() -> u64 {
    std::env::var("VERGENCE_FIRST_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(0)
}
