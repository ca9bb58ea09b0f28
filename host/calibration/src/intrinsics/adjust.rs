//! From a start to the least-squares optimum over the corners that belong to it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::bundle::{Bundle, SHARED, Shared};
use super::lens::LENS;
use super::sights::{FEWEST_CORNERS, FEWEST_VIEWS, Sight, Sighting};
use super::start::Start;
use super::{IntrinsicsError, IntrinsicsOptions, Outlier, OutlierReason};
use crate::arrow::{ArrowNormal, ArrowOptions, Ending, solve};
use crate::reprojection::POSE;
use crate::{Loss, median};

/// Lens and poses on the way.
#[derive(Clone, Debug)]
pub(super) struct State {
    shared: Shared,
    poses: Vec<Isometry3<f64>>,
}

/// The optimum.
pub(super) struct Adjusted {
    pub shared: Shared,
    /// The views that were used, with flags for their corners.
    pub views: Vec<Sighting>,
    pub poses: Vec<Isometry3<f64>>,
    /// Over fx, fy, cx, cy, k1 to k4, the warp where it was asked for, and the poses.
    pub normal: ArrowNormal<POSE>,
    pub outliers: Vec<Outlier>,
}

/// The parameters adjusted at each stage (indices into fx, fy, cx, cy, k1 to k4, warp). The higher powers of θ say little
/// until the lower ones are right.
const FEW: [usize; 5] = [0, 1, 2, 3, 4];
const LENS_ONLY: [usize; LENS] = [0, 1, 2, 3, 4, 5, 6, 7];
const WITH_WARP: [usize; SHARED] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];

/// The robust adjustment of the best of `starts` (given best first): each is tried with few parameters, one goes on.
pub(super) fn robust_fit(views: &[Sighting], starts: &[Start]) -> Option<State> {
    /// Starts within this factor of the first are tried.
    const COMPARABLE: f64 = 2.0;
    let limit = COMPARABLE * starts.first()?.median_px;
    let tried = starts.iter().filter(|start| start.median_px <= limit).filter_map(|start| {
        let poses = start.poses.iter().map(|pose| pose.unwrap_or_else(ahead)).collect();
        let state = robust_stage(views, State { shared: Shared::flat(start.lens), poses }, &FEW, 10)?;
        let cost = of_corners(views, &state, Shared::residual_px).map(|d| COMPARED.cost(d * d)).sum::<f64>();
        cost.is_finite().then_some((cost, state))
    });
    let (_, state) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let state = robust_stage(views, state, &LENS_ONLY, 10)?;
    robust_stage(views, state, &LENS_ONLY, 30)
}

/// How starts are compared: a gross error counts some pixels' worth, however large it is.
const COMPARED: Loss = Loss::Cauchy(1.0);

/// Adjusts the parameters in `free` and the poses with a loss that suits the present residuals.
fn robust_stage(views: &[Sighting], state: State, free: &[usize], iterations: usize) -> Option<State> {
    /// Cauchy's loss is 95 % efficient for Gaussian noise at 2.4 σ, which is 2 median distances.
    const MEDIANS: f64 = 2.0;
    let loss = Loss::Cauchy(MEDIANS * scale(views, &state)?);
    let references: Vec<_> = views.iter().collect();
    let options = ArrowOptions { loss, iterations, relative_cost: 1e-5, ..ArrowOptions::default() };
    let solution = solve(&Bundle { views: &references, free }, state.shared, state.poses, &options);
    let mut state = State { shared: solution.shared, poses: solution.blocks };
    reconsider_poses(views, &mut state, loss);
    Some(state)
}

/// Where a board is taken to be whose corners gave no linear pose.
fn ahead() -> Isometry3<f64> {
    const RANGE_MM: f64 = 500.0;
    Isometry3::translation(0.0, 0.0, RANGE_MM)
}

/// What `measure` tells of every corner.
fn of_corners<'a>(
    views: &'a [Sighting],
    state: &'a State,
    measure: impl Fn(&Shared, &Isometry3<f64>, &Sight) -> f64 + Copy + 'a,
) -> impl Iterator<Item = f64> + 'a {
    let of_view = move |(view, pose): (&'a Sighting, &'a Isometry3<f64>)| {
        view.sights.iter().map(move |sight| measure(&state.shared, pose, sight))
    };
    views.iter().zip(&state.poses).flat_map(of_view)
}

/// The median deviation.
fn scale(views: &[Sighting], state: &State) -> Option<f64> {
    Some(median(of_corners(views, state, Shared::deviation).collect())?.max(FINEST)).filter(|scale| scale.is_finite())
}

/// Noise below this is rounding.
const FINEST: f64 = 1e-4;

/// Gives each board the mirrored tilt where that fits better: a plane's other pose is a local optimum of its own
/// (D. Oberkampf, D. DeMenthon and L. Davis, CVIU 63(3), 1996).
fn reconsider_poses(views: &[Sighting], state: &mut State, loss: Loss) {
    let shared = state.shared;
    state.poses =
        views.par_iter().zip(&state.poses).map(|(view, pose)| better_pose(&shared, view, pose, loss)).collect();
}

fn better_pose(shared: &Shared, view: &Sighting, pose: &Isometry3<f64>, loss: Loss) -> Isometry3<f64> {
    let cost = |pose: &Isometry3<f64>| {
        view.sights.iter().map(|s| 0.5 * loss.cost(shared.deviation(pose, s).powi(2))).sum::<f64>()
    };
    let options = ArrowOptions { loss, iterations: 15, relative_cost: 1e-4, ..ArrowOptions::default() };
    let other = solve(&Bundle { views: &[view], free: &[] }, *shared, vec![mirrored(pose, view)], &options);
    match other.blocks.first() {
        Some(other_pose) if other.cost < cost(pose) => *other_pose,
        _ => *pose,
    }
}

/// `pose` with the board's normal mirrored at the line of sight to its middle.
fn mirrored(pose: &Isometry3<f64>, view: &Sighting) -> Isometry3<f64> {
    let sum = view.sights.iter().fold(Vector3::zeros(), |sum, s| sum + Vector3::new(s.board[0], s.board[1], 0.0));
    let middle = sum / view.sights.len() as f64;
    let seen = pose.rotation * middle + pose.translation.vector;
    let Some(sight) = seen.try_normalize(0.0) else { return *pose };
    let normal = pose.rotation * Vector3::z();
    let turned = sight * (2.0 * normal.dot(&sight)) - normal;
    let turn = UnitQuaternion::rotation_between(&normal, &turned).unwrap_or_default();
    let rotation = turn * pose.rotation;
    Isometry3::from_parts(Translation3::from(seen - rotation * middle), rotation)
}

/// Plain least squares over the corners near their reprojections, repeated until the same corners remain.
pub(super) fn inlier_fit(
    mut views: Vec<Sighting>,
    mut state: State,
    options: &IntrinsicsOptions,
) -> Result<Adjusted, IntrinsicsError> {
    const ROUNDS: usize = 10;
    let free: &[usize] = if options.warp { &WITH_WARP } else { &LENS_ONLY };
    let mut left_out = Vec::new();
    let mut normal = None;
    for _ in 0..ROUNDS {
        let changed = options.outlier_factor.is_some_and(|factor| flag(&mut views, &state, factor));
        if !changed && normal.is_some() {
            break;
        }
        drop_views(&mut views, &mut state, &mut left_out)?;
        let references: Vec<_> = views.iter().collect();
        let arrow = ArrowOptions { iterations: 200, ..ArrowOptions::default() };
        let solution = solve(&Bundle { views: &references, free }, state.shared, state.poses, &arrow);
        if matches!(solution.ending, Ending::Iterations | Ending::NotFinite) {
            return Err(IntrinsicsError::NotConverged);
        }
        state = State { shared: solution.shared, poses: solution.blocks };
        normal = Some(solution.normal);
    }
    let normal = normal.ok_or(IntrinsicsError::NotConverged)?;
    Ok(Adjusted { shared: state.shared, views, poses: state.poses, normal, outliers: left_out })
}

/// Marks the corners to use: those within `factor` median distances of the used ones. Whether any mark changed.
fn flag(views: &mut [Sighting], state: &State, factor: f64) -> bool {
    let used = views.iter().zip(&state.poses).flat_map(|(v, p)| v.used().map(|s| state.shared.deviation(p, s)));
    let Some(median) = median(used.collect()) else { return false };
    let limit = factor * median.max(FINEST);
    let mut changed = false;
    for (view, pose) in views.iter_mut().zip(&state.poses) {
        for sight in &mut view.sights {
            let used = state.shared.deviation(pose, sight) < limit;
            changed |= used != sight.used;
            sight.used = used;
        }
    }
    changed
}

/// Takes out the views most of whose corners are marked: their board is not where they say.
fn drop_views(
    views: &mut Vec<Sighting>,
    state: &mut State,
    left_out: &mut Vec<Outlier>,
) -> Result<(), IntrinsicsError> {
    let agrees = |view: &Sighting| {
        let used = view.used().count();
        used >= FEWEST_CORNERS && 2 * used > view.sights.len()
    };
    let (mut kept, mut poses) = (Vec::with_capacity(views.len()), Vec::with_capacity(views.len()));
    for (view, pose) in views.drain(..).zip(&state.poses) {
        if agrees(&view) {
            kept.push(view);
            poses.push(*pose);
        } else {
            let reason = OutlierReason::ViewDisagrees;
            let outlier = |sight: &Sight| Outlier {
                view: view.index,
                corner: sight.index,
                residual_px: Some(state.shared.residual_px(pose, sight)).filter(|r| r.is_finite()),
                reason,
            };
            left_out.extend(view.sights.iter().map(outlier));
        }
    }
    (*views, state.poses) = (kept, poses);
    if views.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::ViewsDisagree { views: views.len(), needed: FEWEST_VIEWS });
    }
    Ok(())
}
