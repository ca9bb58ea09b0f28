//! A textured room seen by two fisheye cameras, with the truth for every pixel.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]
#![allow(dead_code, reason = "each test binary uses its part")]

use image::GrayImage;
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_matching::{ImagePair, Match};
use vergence_vision::{
    Angle, Frame, ImageSize, KannalaBrandt, Left, Length, Pixel, Point, Right, Transform, UnitRay, World,
};

/// Half field of the lens: r(98°) is half the image's side.
const THETA_MAX: Angle = Angle::from_deg(98.0);
pub const BASELINE_MM: f64 = 145.0;

/// Two cameras in a room with their rendered images.
pub struct Pair {
    pub camera: KannalaBrandt,
    pub world_from_left: Transform<World, Left>,
    pub world_from_right: Transform<World, Right>,
    pub left: GrayImage,
    pub right: GrayImage,
}

/// Comparison of a match with the truth.
pub struct Verdict {
    /// Distance in pixels between the matched right pixel and the true pixel of the left pixel's point.
    pub error_px: f64,
    /// True range from the left camera.
    pub range_mm: f64,
    /// Relative error of the triangulated range.
    pub relative_depth_error: f64,
}

pub fn equidistant(side: u32) -> KannalaBrandt {
    let centre = f64::from(side) / 2.0 - 0.5;
    let k1 = f64::from(side) / 2.0 / THETA_MAX.rad();
    let size = ImageSize { width: side, height: side };
    KannalaBrandt::new([k1, 0.0, 0.0, 0.0, 0.0], 1.0, Pixel { u: centre, v: centre }, THETA_MAX, size).unwrap()
}

impl Pair {
    /// Cameras of `side` × `side` pixels with axes `separation` apart, each a little pitched and rolled.
    pub fn new(side: u32, separation: Angle) -> Self {
        let camera = equidistant(side);
        let half = separation.rad() / 2.0;
        let pose = |x: f64, yaw: f64, pitch: f64, roll: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw)
                * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch)
                * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
            (turn, Vector3::new(x, 40.0, -100.0))
        };
        let (left_turn, left_at) = pose(-BASELINE_MM / 2.0, -half, 0.02, 0.04);
        let (right_turn, right_at) = pose(BASELINE_MM / 2.0, half, -0.015, -0.03);
        let (world_from_left, world_from_right) =
            (Transform::new(left_turn, left_at), Transform::new(right_turn, right_at));
        let left = render(&camera, &world_from_left, 1.0, 1);
        let right = render(&camera, &world_from_right, 0.88, 2);
        Self { camera, world_from_left, world_from_right, left, right }
    }

    pub fn images(&self) -> ImagePair<'_> {
        ImagePair {
            left: &self.left,
            right: &self.right,
            left_camera: &self.camera,
            right_camera: &self.camera,
            left_from_right: self.world_from_left.inverse() * self.world_from_right,
            pose_sigma: Angle::from_deg(0.0),
            nearest: Length::from_mm(300.0),
            masks: [None; 2],
        }
    }

    pub fn judge(&self, found: &Match) -> Verdict {
        let left_ray: UnitRay<Left> = self.camera.unproject(found.left).unwrap();
        let right_ray: UnitRay<Right> = self.camera.unproject(found.right).unwrap();
        let origin = self.world_from_left.origin().mm();
        let range_mm = cast(&origin, &(self.world_from_left * left_ray).vector());
        let right_from_left = self.world_from_right.inverse() * self.world_from_left;
        let truth = self.camera.project_point(&(right_from_left * left_ray.at(range_mm)));
        let error_px = truth.map_or(f64::INFINITY, |t| (t.u - found.right.u).hypot(t.v - found.right.v));
        let depth = triangulated_range(&left_ray, &(right_from_left.inverse() * right_ray), &right_from_left);
        Verdict { error_px, range_mm, relative_depth_error: (depth / range_mm - 1.0).abs() }
    }
}

/// Range along the left ray where it is closest to the right ray.
pub fn triangulated_range(
    left: &UnitRay<Left>,
    right: &UnitRay<Left>,
    right_from_left: &Transform<Right, Left>,
) -> f64 {
    let baseline = right_from_left.inverse().origin().mm();
    let (l, r) = (left.vector(), right.vector());
    let cross = l.cross(&r);
    baseline.cross(&r).dot(&cross) / cross.norm_squared()
}

/// The image of the room, four rays to the pixel, with noise of two grey levels.
fn render<F: Frame + Sync>(
    camera: &KannalaBrandt,
    world_from_camera: &Transform<World, F>,
    gain: f64,
    seed: u64,
) -> GrayImage {
    let ImageSize { width, height } = camera.size();
    let origin = world_from_camera.origin().mm();
    let brightness = |u: f64, v: f64| {
        let ray = *world_from_camera * camera.unproject(Pixel { u, v }).ok()?;
        let at: Point<World> = Point::from_mm(origin + ray.vector() * cast(&origin, &ray.vector()));
        Some(texture(&at.mm()))
    };
    let pixel = |i: u32| {
        let (u, v) = (f64::from(i % width), f64::from(i / width));
        let quarters = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)];
        let sum: f64 = quarters.iter().map(|(du, dv)| brightness(u + du, v + dv).unwrap_or(0.0)).sum();
        let uniform = |k: u64| hash(seed * 1_000_003 + k, u as i64, v as i64);
        let noise = 2.0 * ((0..12).map(uniform).sum::<f64>() - 6.0);
        (gain * sum / 4.0 + noise).round().clamp(0.0, 255.0) as u8
    };
    let pixels = (0..width * height).into_par_iter().map(pixel).collect();
    GrayImage::from_raw(width, height, pixels).unwrap()
}

/// Distance to the first surface along a unit direction: the walls of a room of 4 × 2.6 × 4 m from inside, boxes and
/// balls. Every ray hits a wall.
fn cast(origin: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    const WALLS: ([f64; 3], [f64; 3]) = ([-2000.0, -1300.0, -2000.0], [2000.0, 1300.0, 2000.0]);
    const BOXES: [([f64; 3], [f64; 3]); 4] = [
        ([-500.0, 150.0, 600.0], [-200.0, 500.0, 900.0]),
        ([300.0, -200.0, 900.0], [700.0, 300.0, 1100.0]),
        ([-150.0, -700.0, 700.0], [250.0, -450.0, 1000.0]),
        ([-900.0, -300.0, 1200.0], [-600.0, 300.0, 1500.0]),
    ];
    const BALLS: [([f64; 3], f64); 2] = [([100.0, 350.0, 700.0], 170.0), ([-300.0, -250.0, 1000.0], 200.0)];
    let (_, mut nearest) = slabs(&WALLS, origin, direction);
    for bounds in &BOXES {
        let (enter, leave) = slabs(bounds, origin, direction);
        if enter > 0.0 && enter < leave {
            nearest = nearest.min(enter);
        }
    }
    for (centre, radius) in &BALLS {
        let to_centre = Vector3::from(*centre) - origin;
        let along = to_centre.dot(direction);
        let inside = radius * radius - (to_centre.norm_squared() - along * along);
        if inside > 0.0 && along > 0.0 {
            nearest = nearest.min(along - inside.sqrt());
        }
    }
    nearest
}

/// Where a ray enters and leaves a box.
fn slabs((low, high): &([f64; 3], [f64; 3]), origin: &Vector3<f64>, direction: &Vector3<f64>) -> (f64, f64) {
    (0..3).fold((f64::NEG_INFINITY, f64::INFINITY), |(enter, leave), i| {
        let (p, q) = ((low[i] - origin[i]) / direction[i], (high[i] - origin[i]) / direction[i]);
        (enter.max(p.min(q)), leave.min(p.max(q)))
    })
}

/// Brightness of the solid the scene is carved from: noise of several sizes and blocks with sharp edges. On the left of
/// the far wall everything repeats every 90 mm.
fn texture(at: &Vector3<f64>) -> f64 {
    const PERIOD: f64 = 90.0;
    let repeats = at.z > 1999.0 && at.x < -200.0;
    let at = &if repeats { Vector3::new(at.x, at.y, at.z).map(|c| c.rem_euclid(PERIOD)) } else { *at };
    let smooth: f64 = [(260.0, 60.0), (90.0, 45.0), (35.0, 35.0), (14.0, 25.0)]
        .iter()
        .zip(0..)
        .map(|((size, amplitude), seed)| amplitude * (noise(seed, &(at / *size)) - 0.5))
        .sum();
    let block = at.map(|c| (c / 110.0 + 0.37).floor() as i64);
    let sharp = 60.0 * (hash(9, block.x + 100 * block.z, block.y) - 0.5);
    (125.0 + smooth + sharp).clamp(5.0, 250.0)
}

/// Smoothly interpolated lattice noise in [0, 1].
fn noise(seed: u64, at: &Vector3<f64>) -> f64 {
    let floor = at.map(f64::floor);
    let t = (at - floor).map(|t| t * t * (3.0 - 2.0 * t));
    (0..8)
        .map(|corner| {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let weight: f64 = (0..3).map(|i| if offset[i] == 1 { t[i] } else { 1.0 - t[i] }).product();
            let lattice = |i: usize| floor[i] as i64 + i64::from(offset[i]);
            weight * hash(seed, lattice(0) + 4096 * lattice(2), lattice(1))
        })
        .sum()
}

/// A number in [0, 1) (the finaliser of SplitMix64, Steele et al., OOPSLA 2014).
fn hash(seed: u64, x: i64, y: i64) -> f64 {
    let mut z = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((x as u64).wrapping_mul(0xD1B5_4A32_D192_ED03))
        .wrapping_add((y as u64).wrapping_mul(0x8CB9_2BA7_2F3D_8DD7));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
