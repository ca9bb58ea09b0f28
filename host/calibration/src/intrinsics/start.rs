//! Starting values of the joint adjustment, from the corners alone.
//!
//! Under a hypothetical equidistant lens r = f θ every corner has a bearing, and a target's pose follows linearly from
//! bearings at any angle to the axis. The focal lengths tried cover every lens; the one whose linear poses reproject
//! best is the start. The adjustment finds the higher terms of r(θ).

use nalgebra::{Cholesky, Isometry3, Matrix3, SMatrix, SVector, Translation3, Vector2, Vector3};
use rayon::prelude::*;
use vergence_vision::median;
use vergence_vision::{Camera, ImageSize, KannalaBrandt, OpenCvFisheye, Pixel};

use super::bundle::Shared;
use super::observations::{Observation, ObservedView};
use crate::arun::nearest_rotation;

/// Angles to the axis, in radians, tried for the outermost corner: from a telephoto lens to the widest fisheye, in
/// ratios small enough for the adjustment to bridge.
const OUTERMOST: [f64; 14] = [0.15, 0.21, 0.29, 0.38, 0.5, 0.62, 0.75, 0.9, 1.05, 1.2, 1.4, 1.6, 1.85, 2.2];

/// A lens and a pose per view; `None` for a view whose corners do not determine one.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub lens: OpenCvFisheye,
    pub poses: Vec<Option<Isometry3<f64>>>,
    /// Mean over the views of the median distance between corners and reprojections, in pixels.
    pub median_px: f64,
}

/// The starts worth trying, best first.
pub(super) fn starts(views: &[ObservedView], size: ImageSize) -> Vec<Start> {
    /// Number of views that suffice to compare focal lengths.
    const SCANNED_VIEWS: usize = 8;
    const TRIED: usize = 3;
    let centre = Vector2::new(f64::from(size.width) - 1.0, f64::from(size.height) - 1.0) / 2.0;
    let radii = || views.iter().flat_map(|v| &v.observations).map(|s| (Vector2::from(s.pixel) - centre).norm());
    let outermost = radii().fold(0.0, f64::max);
    let with = |angle: f64, views: &[&ObservedView]| {
        let f = outermost / angle;
        let lens = OpenCvFisheye { fx: f, fy: f, cx: centre.x, cy: centre.y, k: [0.0; 4] };
        start_with(&lens, views, |pixel| equidistant(&lens, pixel))
    };
    let all: Vec<_> = views.iter().collect();
    let some: Vec<_> = all.iter().copied().step_by(views.len().div_ceil(SCANNED_VIEWS).max(1)).collect();
    let mut scanned: Vec<_> = OUTERMOST.par_iter().map(|&angle| (with(angle, &some).median_px, angle)).collect();
    scanned.sort_by(|a, b| a.0.total_cmp(&b.0));
    scanned.truncate(TRIED);
    let mut starts: Vec<_> = scanned.par_iter().map(|&(_, angle)| with(angle, &all)).collect();
    starts.retain(|start| start.median_px.is_finite());
    starts.sort_by(|a, b| a.median_px.total_cmp(&b.median_px));
    starts
}

/// The start for a known lens.
pub(super) fn start_from(lens: &OpenCvFisheye, views: &[ObservedView], size: ImageSize) -> Option<Start> {
    let camera = KannalaBrandt::from_opencv(*lens, lens.largest_theta(size).ok()?, size).ok()?;
    let views: Vec<_> = views.iter().collect();
    Some(start_with(lens, &views, |[u, v]| camera.unproject::<Camera>(Pixel { u, v }).ok().map(|ray| ray.vector())))
}

fn start_with(
    lens: &OpenCvFisheye,
    views: &[&ObservedView],
    bearing: impl Fn([f64; 2]) -> Option<Vector3<f64>>,
) -> Start {
    /// Median distance that a view without a pose counts as, in pixels.
    const LOST_PX: f64 = 1e3;
    let shared = Shared::flat(*lens);
    let (mut poses, mut sum) = (Vec::with_capacity(views.len()), 0.0);
    for view in views {
        let pair = |observation: &Observation| {
            bearing(observation.pixel).map(|bearing| (Vector2::from(observation.target), bearing))
        };
        let pairs: Vec<_> = view.observations.iter().filter_map(pair).collect();
        let pose = robust_linear_pose(&pairs);
        let distances = pose.iter().flat_map(|pose| view.observations.iter().map(|s| shared.residual_px(pose, s)));
        sum += median(distances.collect()).unwrap_or(LOST_PX);
        poses.push(pose);
    }
    Start { lens: *lens, poses, median_px: sum / views.len() as f64 }
}

/// Unit bearing at `pixel` for r = f θ; `None` past 180°.
fn equidistant(lens: &OpenCvFisheye, [u, v]: [f64; 2]) -> Option<Vector3<f64>> {
    let offset = Vector2::new((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy);
    let theta = offset.norm();
    let sideways = if theta > 0.0 { offset * (theta.sin() / theta) } else { offset };
    (theta < std::f64::consts::PI).then(|| Vector3::new(sideways.x, sideways.y, theta.cos()))
}

/// A point of the target in millimetres and its unit bearing.
type Pair = (Vector2<f64>, Vector3<f64>);

/// Linear pose, robust to outliers: if some corners stand out it restarts from the best of a few samples and is
/// reweighted.
fn robust_linear_pose(pairs: &[Pair]) -> Option<Isometry3<f64>> {
    /// For Gaussian noise the largest of a target's errors is some 2.5 median errors.
    const STICKS_OUT: f64 = 3.0;
    const ROUNDS: usize = 3;
    let mut weights = vec![1.0; pairs.len()];
    let direct = linear_pose(pairs, &weights);
    if let Some(pose) = &direct {
        let errors = errors(pose, pairs);
        let largest = errors.iter().copied().fold(0.0, f64::max);
        if largest <= STICKS_OUT * median(errors)? {
            return direct;
        }
    }
    let mut pose = best_sample(pairs)?;
    for _ in 0..ROUNDS {
        let errors = errors(&pose, pairs);
        let scale = 2.0 * median(errors.clone())?;
        weights.iter_mut().zip(&errors).for_each(|(w, e)| *w = (1.0 + (e / scale).powi(2)).powi(-2));
        pose = linear_pose(pairs, &weights)?;
    }
    Some(pose)
}

/// The pose from the sample of corners that leaves the least median error (P. Rousseeuw, "Least median of squares
/// regression", 1984). The samples are the same every time: steps of the golden ratio through the list spread over the
/// target.
fn best_sample(pairs: &[Pair]) -> Option<Isometry3<f64>> {
    /// Some clean ones are among them even if a fifth of the corners is wrong: (1 − 0.8⁶)¹⁶ < 1 %.
    const SAMPLES: usize = 16;
    const SAMPLE: usize = 6;
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let nth = |i: usize| {
        let place = (i as f64 * GOLDEN).fract() * pairs.len() as f64;
        pairs.get(place as usize).copied()
    };
    let poses = (0..SAMPLES).filter_map(|sample| {
        let picked: Vec<Pair> = (SAMPLE * sample..SAMPLE * (sample + 1)).filter_map(nth).collect();
        let pose = linear_pose(&picked, &[1.0; SAMPLE])?;
        Some((median(errors(&pose, pairs))?, pose))
    });
    poses.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pose)| pose)
}

/// Distances between bearings and the directions of the target's points: angles in radians if small.
fn errors(pose: &Isometry3<f64>, pairs: &[Pair]) -> Vec<f64> {
    let rotation = pose.rotation.to_rotation_matrix();
    let error = |(target, bearing): &Pair| {
        let point = rotation * Vector3::new(target.x, target.y, 0.0) + pose.translation.vector;
        (point / point.norm() - bearing).norm()
    };
    pairs.iter().map(error).collect()
}

/// The target's pose from weighted target points (millimetres) and unit bearings f: minimises Σ w ‖(I − f fᵀ) H q‖²
/// over H ~ `[r1 r2 t]`, q = (x, y, 1); the direct linear transform on bearings (R. Hartley and A. Zisserman, *Multiple
/// View Geometry*, 2004, section 4.1). Nothing is divided by z, so the field past 90° needs no special case.
fn linear_pose(pairs: &[Pair], weights: &[f64]) -> Option<Isometry3<f64>> {
    let (centre, spread) = normalisation(pairs)?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let normalised = |target: &Vector2<f64>| ((target - centre) / spread).push(1.0);
    for ((target, bearing), weight) in pairs.iter().zip(weights) {
        let q = normalised(target);
        let (across, outer) = (Matrix3::identity() - bearing * bearing.transpose(), q * q.transpose() * *weight);
        for i in 0..3 {
            for j in i..3 {
                let mut part = normal.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                part += outer * across[(i, j)];
            }
        }
    }
    normal.fill_lower_triangle_with_upper_triangle();
    let h = smallest_eigenvector(&normal)?;
    let homography = Matrix3::from_row_slice(h.as_slice());
    let facing: f64 = pairs.iter().map(|(target, bearing)| bearing.dot(&(homography * normalised(target)))).sum();
    let homography = homography * facing.signum();
    let (h1, h2) = (homography.column(0).into_owned(), homography.column(1).into_owned());
    let length = 0.5 * (h1.norm() + h2.norm());
    let rotation =
        nearest_rotation(&Matrix3::from_columns(&[h1 / length, h2 / length, h1.cross(&h2) / (length * length)]))?;
    let middle = homography.column(2) * (spread / length);
    let translation = middle - rotation * centre.push(0.0);
    Some(Isometry3::from_parts(Translation3::from(translation), rotation))
}

/// Centre and scale that condition the linear system; `None` for fewer points than it needs.
fn normalisation(pairs: &[Pair]) -> Option<(Vector2<f64>, f64)> {
    const FEWEST: usize = 4;
    if pairs.len() < FEWEST {
        return None;
    }
    let n = pairs.len() as f64;
    let centre = pairs.iter().map(|(target, _)| target).sum::<Vector2<f64>>() / n;
    let spread = (pairs.iter().map(|(target, _)| (target - centre).norm_squared()).sum::<f64>() / n).sqrt();
    (spread > 0.0).then_some((centre, spread))
}

/// Eigenvector of the smallest eigenvalue, by inverse iteration (G. Golub and C. Van Loan, *Matrix Computations*, 2013,
/// section 8.2.2).
fn smallest_eigenvector(matrix: &SMatrix<f64, 9, 9>) -> Option<SVector<f64, 9>> {
    const ROUNDS: usize = 8;
    /// Keeps the factor positive for exact data, where the smallest eigenvalue is zero.
    const SHIFT: f64 = 1e-13;
    let shift = SMatrix::identity() * (SHIFT * matrix.trace());
    let factor = Cholesky::new(matrix + shift)?;
    let mut vector = SVector::<f64, 9>::from([1.0, 0.31, -0.27, -0.44, 0.93, 0.19, 0.11, -0.36, 1.2]);
    for _ in 0..ROUNDS {
        vector = factor.solve(&vector).try_normalize(0.0)?;
    }
    Some(vector)
}
