//! `vergence bench vision`: what a point costs.

use std::hint::black_box;

use nalgebra::{Matrix6, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use vergence_vision::{
    Angle, BatchLens, BatchPair, BatchTriangulation, Camera, ImageSize, Instructions, KannalaBrandt, Left,
    OpenCvFisheye, Pixel, Right, SharedCovariance, StereoPair, Transform, UnitRay, triangulate_batch,
};

use super::peer_opencv::{PeerTimes, opencv};
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Measures arrays of N x 3 and N x 2 numbers, on one thread: nanoseconds per point, the least of several runs, with OpenCV
/// and ours taking turns. Pixels and rays go into arrays allocated anew, and so do points with the errors they share; points with their
/// closed-form covariance, 56 bytes each, into arrays that are there ("anew": allocated again for every run). Without OpenCV (python3 -m pip install opencv-python-headless numpy) its
/// figures are null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many points.
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(100..=20_000_000))]
    points: u32,
    /// How often each is measured.
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
}

/// How often OpenCV and ours take turns, so that a busy moment of the machine does not fall on one of them alone.
const ROUNDS: u32 = 4;
/// Rays are spread over 0° to 99° of the axis.
const FIELD: Angle = Angle::from_deg(99.0);
const LENS: OpenCvFisheye =
    OpenCvFisheye { fx: 599.0, fy: 598.5, cx: 959.5, cy: 767.5, k: [0.01, -0.004, 0.001, -0.0002] };
const SIZE: ImageSize = ImageSize { width: 1920, height: 1536 };
const PIXEL_SIGMA: f64 = 0.1;
const RAY_SIGMA: Angle = Angle::from_rad(PIXEL_SIGMA / 599.0);

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let lens = KannalaBrandt::from_opencv(LENS, Angle::from_deg(99.5), SIZE)
        .map_err(|error| Failure::check(format!("the bench's lens: {error}")))?;
    let (mut ours, mut baseline, mut peer) = (Times::NEVER, Times::NEVER, Err(String::new()));
    for round in 0..ROUNDS {
        let theirs = opencv(&args.python, args.points, args.repeats, &LENS, FIELD);
        peer = match (peer, theirs) {
            (Ok(peer), Ok(theirs)) => Ok(PeerTimes::least(peer, &theirs)),
            (Err(_), theirs) if round == 0 => theirs,
            (peer, _) => peer,
        };
        ours = ours.least(&measure(&lens, args.points, args.repeats, Instructions::Best));
        baseline = baseline.least(&measure(&lens, args.points, args.repeats, Instructions::Baseline));
    }
    let error = [Instructions::Best, Instructions::Baseline].map(|which| max_ray_error(&lens, which));
    let error = error[0].max(error[1]);

    let best = Instructions::best_name();
    console.say(format!("{} points, one thread, ns per point (ratio to OpenCV)", args.points))?;
    for (name, times) in [(best, &ours), ("baseline", &baseline)] {
        console.say(format!("{name:>10}: {}", times.in_words(peer.as_ref().ok())))?;
    }
    match &peer {
        Ok(peer) => console.say(format!(
            "{:>10}: project {:.1}, unproject {:.1} (version {})",
            "OpenCV", peer.project_ns, peer.unproject_ns, peer.version
        ))?,
        Err(why) => console.say(format!("no OpenCV beside: {why}"))?,
    }
    console.say(format!("largest error of a ray over 0° to 99°: {error:.1e} rad"))?;
    let sizes = [1_000, 10_000, 100_000, args.points];
    let growth: Vec<_> = sizes.map(|points| (points, measure(&lens, points, args.repeats, Instructions::Best))).into();
    for (points, times) in &growth {
        console.say(format!("{points:>10} points: {}", times.in_words(None)))?;
    }
    console.result(&json!({
        "project_ns": ours.project_ns,
        "unproject_ns": ours.unproject_ns,
        "max_ray_error_rad": error,
        "triangulate_mpts_per_s": 1e3 / ours.triangulate_ns,
        "triangulate_allocated_anew_mpts_per_s": 1e3 / ours.triangulate_anew_ns,
        "triangulate_full_mpts_per_s": 1e3 / ours.full_ns,
        "instructions": best,
        "baseline": baseline.json(),
        "opencv": peer.as_ref().map_or(Value::Null, PeerTimes::json),
        "growth": growth.iter().map(|(points, times)| times.json_at(*points)).collect::<Vec<_>>(),
    }))
}

/// Nanoseconds per point.
struct Times {
    project_ns: f64,
    unproject_ns: f64,
    /// Into arrays that are there.
    triangulate_ns: f64,
    /// Into arrays allocated anew, whose pages the system must clear.
    triangulate_anew_ns: f64,
    full_ns: f64,
}

impl Times {
    const NEVER: Self = Self {
        project_ns: f64::INFINITY,
        unproject_ns: f64::INFINITY,
        triangulate_ns: f64::INFINITY,
        triangulate_anew_ns: f64::INFINITY,
        full_ns: f64::INFINITY,
    };

    fn least(&self, other: &Self) -> Self {
        Self {
            project_ns: self.project_ns.min(other.project_ns),
            unproject_ns: self.unproject_ns.min(other.unproject_ns),
            triangulate_ns: self.triangulate_ns.min(other.triangulate_ns),
            triangulate_anew_ns: self.triangulate_anew_ns.min(other.triangulate_anew_ns),
            full_ns: self.full_ns.min(other.full_ns),
        }
    }

    fn in_words(&self, peer: Option<&PeerTimes>) -> String {
        let ratio = |ours: f64, theirs: f64| format!(" ({:.3})", ours / theirs);
        let project = peer.map_or(String::new(), |peer| ratio(self.project_ns, peer.project_ns));
        let unproject = peer.map_or(String::new(), |peer| ratio(self.unproject_ns, peer.unproject_ns));
        format!(
            "project {:.1}{project}, unproject {:.1}{unproject}, triangulate {:.1} (anew {:.1}, with shared errors {:.0})",
            self.project_ns, self.unproject_ns, self.triangulate_ns, self.triangulate_anew_ns, self.full_ns
        )
    }

    fn json(&self) -> Value {
        json!({
            "project_ns": self.project_ns,
            "unproject_ns": self.unproject_ns,
            "triangulate_mpts_per_s": 1e3 / self.triangulate_ns,
            "triangulate_full_mpts_per_s": 1e3 / self.full_ns,
        })
    }

    fn json_at(&self, points: u32) -> Value {
        json!({
            "points": points,
            "project_ns": self.project_ns,
            "unproject_ns": self.unproject_ns,
            "triangulate_ns": self.triangulate_ns,
            "triangulate_anew_ns": self.triangulate_anew_ns,
            "triangulate_full_ns": self.full_ns,
        })
    }
}

fn measure(lens: &KannalaBrandt, points: u32, repeats: u32, instructions: Instructions) -> Times {
    let batch = BatchLens::new(lens).with_instructions(instructions);
    let rays = spread(points);
    let pixels = batch.project(&rays);
    let (left, right, left_from_right) = sights(points);
    let centre = left_from_right.origin();
    let pair = StereoPair { left: lens, right: lens, left_from_right };
    let shared =
        SharedCovariance::exact().with_pose(&Matrix6::from_diagonal(&[1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e-4].into()));
    let uncertain = BatchPair::new(&pair, PIXEL_SIGMA, &shared).with_instructions(instructions);
    let right_from_left = left_from_right.rotation().inverse();
    let in_right: Vec<[f64; 3]> = right.iter().map(|ray| (right_from_left * Vector3::from(*ray)).into()).collect();
    let mut triangulated = BatchTriangulation::new(&centre);
    let per_point = |count: usize, work: &mut dyn FnMut()| least_seconds(repeats, work) * 1e9 / count as f64;
    Times {
        project_ns: per_point(rays.len(), &mut || drop(black_box(batch.project(black_box(&rays))))),
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

fn least_seconds(repeats: u32, work: &mut dyn FnMut()) -> f64 {
    let once = |_| {
        let watch = Stopwatch::start();
        work();
        watch.seconds()
    };
    (0..repeats).map(once).fold(f64::INFINITY, f64::min)
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

/// Left rays, right rays, and the pose that both are of.
type Sights = (Vec<[f64; 3]>, Vec<[f64; 3]>, Transform<Left, Right>);

/// Rays of both cameras, in the left frame, to points 0.3 to 2 m ahead of a rig in herbivore pose.
fn sights(points: u32) -> Sights {
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

/// Against the single-point functions: of pixels, over the focal length, and of rays.
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
    // What one of both refuses counts as wrong altogether.
    rays.iter().zip(&pixels).zip(&back).map(|row| error(row).unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}
