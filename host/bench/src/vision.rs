//! Cost of a point: projection, unprojection and triangulation of whole arrays, beside OpenCV.

use std::hint::black_box;

use nalgebra::{Matrix6, UnitQuaternion, Vector3};
use vergence_vision::{
    Angle, BatchLens, BatchPair, BatchTriangulation, Camera, ImageSize, Instructions, KannalaBrandt, Left,
    OpenCvFisheye, Pixel, Right, SharedCovariance, StereoPair, Transform, UnitRay, triangulate_batch,
};

use crate::error::BenchError;
use crate::python::ask_python;
use crate::{Clock, timed};

/// OpenCV and this program take turns this often, so that a busy moment of the machine does not fall on one alone.
const ROUNDS: u32 = 4;
/// Rays are spread over 0° to 99° from the optical axis.
const FIELD: Angle = Angle::from_deg(99.0);
const LENS: OpenCvFisheye =
    OpenCvFisheye { fx: 599.0, fy: 598.5, cx: 959.5, cy: 767.5, k: [0.01, -0.004, 0.001, -0.0002] };
const SIZE: ImageSize = ImageSize { width: 1920, height: 1536 };
const PIXEL_SIGMA: f64 = 0.1;
const RAY_SIGMA: Angle = Angle::from_rad(PIXEL_SIGMA / 599.0);
/// Script that times OpenCV; it needs only OpenCV and numpy.
const OPENCV: &str = include_str!("opencv_fisheye.py");

/// Figures of one run.
#[derive(Clone, Debug)]
pub struct VisionBench {
    /// Name of the fastest instructions of this processor.
    pub instructions: &'static str,
    /// Times with the fastest instructions.
    pub best: VisionTimes,
    /// Times with the instructions that every processor of this kind has.
    pub baseline: VisionTimes,
    /// OpenCV's times, or a sentence that says why there are none.
    pub opencv: Result<OpenCvTimes, String>,
    /// Largest error of a ray or pixel over the field against the functions for single points, in radians.
    pub max_ray_error: f64,
    /// Times with the fastest instructions over the count of points.
    pub growth: Vec<(u32, VisionTimes)>,
}

/// Nanoseconds per point, the least of all runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisionTimes {
    /// Projection of rays to pixels, into a new array.
    pub project_ns: f64,
    /// Projection with the derivatives by the point and by the lens, into a new array.
    pub derivatives_ns: f64,
    /// Unprojection of pixels to rays, into a new array.
    pub unproject_ns: f64,
    /// Triangulation with closed-form covariances, into arrays that exist.
    pub triangulate_ns: f64,
    /// The same into new arrays, whose pages the system must clear.
    pub triangulate_anew_ns: f64,
    /// Triangulation with the errors that the points share, into new arrays.
    pub full_ns: f64,
}

/// OpenCV's nanoseconds per point, the least of all runs.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct OpenCvTimes {
    /// `cv2.fisheye.distortPoints` of x / z and y / z, up to 88° from the axis.
    pub project_ns: f64,
    /// `cv2.fisheye.projectPoints`, which computes the derivatives by lens and pose too, asked or not.
    pub derivatives_ns: f64,
    /// `cv2.fisheye.undistortPoints`.
    pub unproject_ns: f64,
    /// OpenCV's version.
    pub version: String,
}

/// Measures arrays of `points` points on one thread, each kind of work `repeats` times in each of several rounds; `python`
/// is the interpreter that has OpenCV.
///
/// # Errors
/// Where the lens of the measurement is refused.
pub fn vision(points: u32, repeats: u32, python: &str, clock: Clock) -> Result<VisionBench, BenchError> {
    let lens = KannalaBrandt::from_opencv(LENS, Angle::from_deg(99.5), SIZE)
        .map_err(|error| BenchError::Work(format!("the lens of the measurement: {error}")))?;
    let times = |points, instructions| measure(&lens, points, repeats, instructions, clock);
    let (mut best, mut baseline, mut peer) = (VisionTimes::NEVER, VisionTimes::NEVER, Err(String::new()));
    for round in 0..ROUNDS {
        let theirs = opencv(python, points, repeats);
        peer = match (peer, theirs) {
            (Ok(peer), Ok(theirs)) => Ok(OpenCvTimes::least(peer, &theirs)),
            (Err(_), theirs) if round == 0 => theirs,
            (peer, _) => peer,
        };
        best = best.least(&times(points, Instructions::Best));
        baseline = baseline.least(&times(points, Instructions::Baseline));
    }
    let errors = [Instructions::Best, Instructions::Baseline].map(|which| max_ray_error(&lens, which));
    let sizes = [1_000, 10_000, 100_000, points];
    Ok(VisionBench {
        instructions: Instructions::best_name(),
        best,
        baseline,
        opencv: peer,
        max_ray_error: errors[0].max(errors[1]),
        growth: sizes.map(|points| (points, times(points, Instructions::Best))).into(),
    })
}

/// Times OpenCV in `python`; the error says why it could not.
fn opencv(python: &str, points: u32, repeats: u32) -> Result<OpenCvTimes, String> {
    let numbers = [LENS.fx, LENS.fy, LENS.cx, LENS.cy].into_iter().chain(LENS.k).chain([FIELD.deg()]);
    let arguments = [points.to_string(), repeats.to_string()];
    ask_python(python, OPENCV, arguments.into_iter().chain(numbers.map(|number| number.to_string())))
}

impl OpenCvTimes {
    fn least(self, other: &Self) -> Self {
        Self {
            project_ns: self.project_ns.min(other.project_ns),
            derivatives_ns: self.derivatives_ns.min(other.derivatives_ns),
            unproject_ns: self.unproject_ns.min(other.unproject_ns),
            version: self.version,
        }
    }
}

impl VisionTimes {
    const NEVER: Self = Self {
        project_ns: f64::INFINITY,
        derivatives_ns: f64::INFINITY,
        unproject_ns: f64::INFINITY,
        triangulate_ns: f64::INFINITY,
        triangulate_anew_ns: f64::INFINITY,
        full_ns: f64::INFINITY,
    };

    fn least(&self, other: &Self) -> Self {
        Self {
            project_ns: self.project_ns.min(other.project_ns),
            derivatives_ns: self.derivatives_ns.min(other.derivatives_ns),
            unproject_ns: self.unproject_ns.min(other.unproject_ns),
            triangulate_ns: self.triangulate_ns.min(other.triangulate_ns),
            triangulate_anew_ns: self.triangulate_anew_ns.min(other.triangulate_anew_ns),
            full_ns: self.full_ns.min(other.full_ns),
        }
    }
}

fn measure(lens: &KannalaBrandt, points: u32, repeats: u32, instructions: Instructions, clock: Clock) -> VisionTimes {
    let batch = BatchLens::new(lens).with_instructions(instructions);
    let rays = spread(points);
    let pixels = batch.project(&rays);
    let (left, right, left_from_right) = ray_pairs(points);
    let centre = left_from_right.origin();
    let pair = StereoPair { left: lens, right: lens, left_from_right };
    let shared =
        SharedCovariance::exact().with_pose(&Matrix6::from_diagonal(&[1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e-4].into()));
    let uncertain = BatchPair::new(&pair, PIXEL_SIGMA, &shared).with_instructions(instructions);
    let right_from_left = left_from_right.rotation().inverse();
    let in_right: Vec<[f64; 3]> = right.iter().map(|ray| (right_from_left * Vector3::from(*ray)).into()).collect();
    let mut triangulated = BatchTriangulation::new(&centre);
    let per_point = |count: usize, work: &mut dyn FnMut()| least_seconds(repeats, clock, work) * 1e9 / count as f64;
    VisionTimes {
        project_ns: per_point(rays.len(), &mut || drop(black_box(batch.project(black_box(&rays))))),
        derivatives_ns: per_point(rays.len(), &mut || {
            drop(black_box(batch.project_with_derivatives(black_box(&rays))));
        }),
        unproject_ns: per_point(pixels.len(), &mut || drop(black_box(batch.unproject(black_box(&pixels))))),
        triangulate_ns: per_point(left.len(), &mut || {
            triangulated.clear();
            triangulated.extend([black_box(&left), &right], RAY_SIGMA, instructions);
            black_box(&triangulated);
        }),
        triangulate_anew_ns: per_point(left.len(), &mut || {
            drop(black_box(triangulate_batch(black_box(&left), &right, &centre, RAY_SIGMA, instructions)));
        }),
        full_ns: per_point(left.len(), &mut || {
            drop(black_box(uncertain.triangulate(black_box(&left), &in_right)));
        }),
    }
}

fn least_seconds(repeats: u32, clock: Clock, work: &mut dyn FnMut()) -> f64 {
    (0..repeats).map(|_| timed(clock, &mut *work).1).fold(f64::INFINITY, f64::min)
}

/// Unit rays in a spiral over the field.
fn spread(points: u32) -> Vec<[f64; 3]> {
    let ray = |i: u32| {
        let theta = FIELD.rad() * (f64::from(i) + 0.5) / f64::from(points);
        let (sine, cosine) = theta.sin_cos();
        let phi = 2.399_963 * f64::from(i);
        [sine * phi.cos(), sine * phi.sin(), cosine]
    };
    (0..points).map(ray).collect()
}

/// Left rays, right rays in the left frame, and the pose of the cameras.
type RayPairs = (Vec<[f64; 3]>, Vec<[f64; 3]>, Transform<Left, Right>);

/// Rays of both cameras, in the left frame, to points 0.3 to 2 m ahead of a rig in herbivore pose.
fn ray_pairs(points: u32) -> RayPairs {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 120f64.to_radians());
    let middle = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 60f64.to_radians());
    let left_from_right = Transform::new(turn, middle * Vector3::new(145.0, 0.0, 0.0));
    let centre = left_from_right.origin().mm();
    let pair = |i: u32| -> ([f64; 3], [f64; 3]) {
        let (a, b) = (0.4 * (0.7 * f64::from(i)).sin(), 0.7 * (1.3 * f64::from(i)).cos());
        let range = 1150.0 + 850.0 * (0.37 * f64::from(i)).sin();
        let point = middle * Vector3::new(a.sin() * b.cos(), b.sin(), a.cos() * b.cos()) * range + centre / 2.0;
        (point.normalize().into(), (point - centre).normalize().into())
    };
    let (left, right) = (0..points).map(pair).unzip();
    (left, right, left_from_right)
}

/// Largest difference from the functions for single points, in radians: of rays, and of pixels over the focal length.
fn max_ray_error(lens: &KannalaBrandt, instructions: Instructions) -> f64 {
    const RAYS: u32 = 200_000;
    let batch = BatchLens::new(lens).with_instructions(instructions);
    let rays = spread(RAYS);
    let pixels = batch.project(&rays);
    let back = batch.unproject(&pixels);
    let error = |((ray, &[u, v]), back): ((&[f64; 3], &[f64; 2]), &[f64; 3])| {
        let pixel = UnitRay::<Camera>::new(Vector3::from(*ray)).and_then(|ray| lens.project(&ray).ok())?;
        let ray = lens.unproject::<Camera>(Pixel { u, v }).ok()?;
        let projected = (u - pixel.u).hypot(v - pixel.v) / LENS.fx;
        let unprojected = (Vector3::from(*back) - ray.vector()).norm();
        let worse = projected.max(unprojected);
        worse.is_finite().then_some(worse)
    };
    // A ray that only one of both refuses counts as an infinite error.
    rays.iter().zip(&pixels).zip(&back).map(|row| error(row).unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}
