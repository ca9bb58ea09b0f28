//! Cost of a point: projection, unprojection and triangulation of whole arrays, beside OpenCV.

use std::hint::black_box;

use nalgebra::{SMatrix, UnitQuaternion, Vector3};
use vergence_vision::{
    Angle, BatchLens, BatchPair, BatchPoints, BatchTriangulation, CENTRAL_PARAMETERS, Camera, ImageSize, Instructions,
    KannalaBrandt, LENS_PARAMETERS, Left, OpenCvFisheye, Pixel, ProjectedPoints, Right, SHARED_PARAMETERS,
    SharedCovariance, StereoPair, Transform, UnitRay,
};

use crate::error::BenchError;
use crate::lenses::{LensTimes, lenses};
use crate::levels::{LevelTimes, levels};
use crate::python::ask_python;
use crate::{Clock, timed};

/// OpenCV and this program take turns this often, so that a busy moment of the machine does not fall on one alone.
const ROUNDS: u32 = 4;
/// How often each lens is measured for each repeat of the others: its arrays are small.
const LENS_TURNS: u32 = 4;
/// Rays are spread over 0° to 99° from the optical axis.
const FIELD: Angle = Angle::from_deg(99.0);
const LENS: OpenCvFisheye =
    OpenCvFisheye { fx: 599.0, fy: 598.5, cx: 959.5, cy: 767.5, k: [0.01, -0.004, 0.001, -0.0002] };
const SIZE: ImageSize = ImageSize { width: 1920, height: 1536 };
const PIXEL_SIGMA: f64 = 0.1;
const RAY_SIGMA: Angle = Angle::from_rad(PIXEL_SIGMA / 599.0);
/// Standard deviations of what a pair shares, about those of a calibration: of each lens, which is central, then of the pose.
const LENS_SIGMAS: [f64; CENTRAL_PARAMETERS] = [0.05, 0.05, 0.04, 0.04, 2e-4, 3e-4, 2e-4, 5e-5];
const POSE_SIGMAS: [f64; 6] = [1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2];
/// Script that times OpenCV; it needs only OpenCV and numpy.
const OPENCV: &str = include_str!("opencv_fisheye.py");

/// Figures of one run.
#[derive(Clone, Debug)]
pub struct VisionBench {
    /// Name of the fastest instructions of this processor.
    pub instructions: &'static str,
    /// Times with the fastest instructions, into arrays that exist.
    pub best: VisionTimes,
    /// The same into new arrays, whose pages the system must clear.
    pub anew: VisionTimes,
    /// Times with the instructions that every processor of this kind has, into arrays that exist.
    pub baseline: VisionTimes,
    /// OpenCV's times, or a sentence that says why there are none.
    pub opencv: Result<OpenCvTimes, String>,
    /// Largest error of a ray or pixel over the field against the functions for single points, in radians.
    pub max_ray_error: f64,
    /// Times by the lenses of other programs' models, a polynomial lens first, with the fastest instructions, of arrays that stay in the cache.
    pub lenses: Vec<LensTimes>,
    /// Times of a whole use by each kind of lens of this program, one centre first.
    pub levels: Vec<LevelTimes>,
    /// Times with the fastest instructions over the count of points.
    pub growth: Vec<(u32, VisionTimes)>,
}

/// Nanoseconds per point, the least of all runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisionTimes {
    /// Projection of rays to pixels.
    pub project_ns: f64,
    /// Projection with the derivatives by the point and by the lens.
    pub derivatives_ns: f64,
    /// Unprojection of pixels to rays.
    pub unproject_ns: f64,
    /// Triangulation with closed-form covariances.
    pub triangulate_ns: f64,
    /// Triangulation with all that the points share: both lenses and the pose, every parameter correlated with all others.
    pub full_ns: f64,
}

/// Where results go.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Memory {
    /// Into arrays that the first run has made.
    Kept,
    /// Into new arrays in every run.
    New,
}

/// OpenCV's nanoseconds per point, the least of all runs, into arrays that exist.
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
    let times = |points, instructions, memory| measure(&lens, points, repeats, (instructions, memory), clock);
    let ([mut best, mut anew, mut baseline], mut peer) = ([VisionTimes::NEVER; 3], Err(String::new()));
    for round in 0..ROUNDS {
        let theirs = opencv(python, points, repeats);
        peer = match (peer, theirs) {
            (Ok(peer), Ok(theirs)) => Ok(OpenCvTimes::least(peer, &theirs)),
            (Err(_), theirs) if round == 0 => theirs,
            (peer, _) => peer,
        };
        best = best.least(&times(points, Instructions::Best, Memory::Kept));
        anew = anew.least(&times(points, Instructions::Best, Memory::New));
        baseline = baseline.least(&times(points, Instructions::Baseline, Memory::Kept));
    }
    let errors = [Instructions::Best, Instructions::Baseline].map(|which| max_ray_error(&lens, which));
    let sizes = [1_000, 10_000, 100_000, points];
    Ok(VisionBench {
        instructions: Instructions::best_name(),
        best,
        anew,
        baseline,
        opencv: peer,
        max_ray_error: errors[0].max(errors[1]),
        lenses: lenses(LENS_TURNS * repeats, clock)?,
        levels: levels(repeats, clock)?,
        growth: sizes.map(|points| (points, times(points, Instructions::Best, Memory::Kept))).into(),
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
        full_ns: f64::INFINITY,
    };

    fn least(&self, other: &Self) -> Self {
        Self {
            project_ns: self.project_ns.min(other.project_ns),
            derivatives_ns: self.derivatives_ns.min(other.derivatives_ns),
            unproject_ns: self.unproject_ns.min(other.unproject_ns),
            triangulate_ns: self.triangulate_ns.min(other.triangulate_ns),
            full_ns: self.full_ns.min(other.full_ns),
        }
    }
}

fn measure(
    lens: &KannalaBrandt,
    points: u32,
    repeats: u32,
    (instructions, memory): (Instructions, Memory),
    clock: Clock,
) -> VisionTimes {
    let batch = BatchLens::new(lens).with_instructions(instructions);
    let rays = spread(points);
    let pixels = batch.project(&rays);
    let (left, right, left_from_right) = ray_pairs(points);
    let centre = left_from_right.origin();
    let pair = StereoPair { left: lens, right: lens, left_from_right };
    let uncertain = BatchPair::new(&pair, PIXEL_SIGMA, &shared()).with_instructions(instructions);
    let right_from_left = left_from_right.rotation().inverse();
    let in_right: Vec<[f64; 3]> = right.iter().map(|ray| (right_from_left * Vector3::from(*ray)).into()).collect();
    let run = Run { repeats, memory, points, clock };
    VisionTimes {
        project_ns: run.per_point(Vec::new, |out| {
            out.clear();
            batch.project_into(black_box(&rays), out);
        }),
        derivatives_ns: run.per_point(ProjectedPoints::default, |out| {
            batch.project_with_derivatives_into(black_box(&rays), out);
        }),
        unproject_ns: run.per_point(Vec::new, |out| {
            out.clear();
            batch.unproject_into(black_box(&pixels), out);
        }),
        triangulate_ns: run.per_point(
            || BatchTriangulation::new(&centre),
            |out| {
                out.clear();
                out.extend([black_box(&left), &right], RAY_SIGMA, instructions);
            },
        ),
        full_ns: run.per_point(BatchPoints::default, |out| {
            out.clear();
            uncertain.triangulate_into(black_box(&left), &in_right, out);
        }),
    }
}

/// How each kind of work is measured.
struct Run {
    repeats: u32,
    memory: Memory,
    points: u32,
    clock: Clock,
}

impl Run {
    /// The least nanoseconds per point of all runs of `work`, whose results go into what `new` makes. With new memory, the time
    /// to give it back counts too.
    fn per_point<T>(&self, new: impl Fn() -> T, mut work: impl FnMut(&mut T)) -> f64 {
        let mut out = new();
        if self.memory == Memory::Kept {
            work(&mut out);
        }
        let seconds = least_seconds(self.repeats, self.clock, &mut || {
            if self.memory == Memory::New {
                out = new();
            }
            work(&mut out);
            black_box(&out);
        });
        seconds * 1e9 / f64::from(self.points)
    }
}

/// A covariance of lenses and pose in which every parameter is correlated with all others.
fn shared() -> SharedCovariance {
    let absent = [0.0; LENS_PARAMETERS - CENTRAL_PARAMETERS];
    let sigmas: Vec<f64> = [&LENS_SIGMAS[..], &absent, &LENS_SIGMAS, &absent, &POSE_SIGMAS].concat();
    let mixed = SMatrix::<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>::from_fn(|row, column| {
        sigmas[row] * if row == column { 1.0 } else { 0.2 * (7.0 * row as f64 + 3.0 * column as f64).sin() }
    });
    SharedCovariance::joint(mixed * mixed.transpose())
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
