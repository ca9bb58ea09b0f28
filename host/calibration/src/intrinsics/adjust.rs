//! Adjustment: from a start to the least-squares optimum without outliers.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_vision::median;

use super::bundle::{Bundle, SHARED, Shared};
use super::lens::{CENTRAL, E0, E1, K5, K6, LENS, LensParameters};
use super::observations::{FEWEST_CORNERS, FEWEST_VIEWS, Observation, ObservedView};
use super::prior::{FINEST, Prior, Strength};
use super::start::Start;
use super::{IntrinsicsError, IntrinsicsOptions, Outlier, OutlierReason};
use crate::Loss;
use crate::reprojection::POSE;
use crate::schur_lm::{Ending, SchurNormal, SchurOptions, solve};

/// Lens and target poses during the adjustment.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub shared: Shared,
    pub poses: Vec<Isometry3<f64>>,
}

/// The optimum: lens, target poses, and which corners were used.
#[derive(Clone)]
pub(super) struct Adjusted {
    pub shared: Shared,
    /// The views used, with a flag for each corner.
    pub views: Vec<ObservedView>,
    pub poses: Vec<Isometry3<f64>>,
    /// The parameters adjusted (indices into those of the lens, then the warp), in the order of the normal matrix.
    pub free: Vec<usize>,
    /// Over the parameters adjusted and the poses.
    pub normal: SchurNormal<POSE>,
    /// How strongly the prior counts.
    pub strength: Option<Strength>,
    /// Variance by which the prior was weighted, over that of the residuals.
    pub prior_factor: f64,
    pub outliers: Vec<Outlier>,
}

/// The parameters adjusted at each stage (indices into those of the lens, then the warp). The coefficients of higher
/// powers of θ follow once the lower ones are right.
const FEW: [usize; 5] = [0, 1, 2, 3, 4];
const CENTRAL_LENS: [usize; CENTRAL] = [0, 1, 2, 3, 4, 5, 6, 7];

/// What a lens has besides the parameters of a central and symmetric one, and whether the target bows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Terms {
    pub e0: bool,
    pub e1: bool,
    pub asymmetry: bool,
    /// k5 and k6.
    pub further: bool,
    pub bow: bool,
}

impl Terms {
    /// A lens with one centre.
    pub const fn central(bow: bool) -> Self {
        Self { e0: false, e1: false, asymmetry: false, further: false, bow }
    }

    /// A lens with a pupil of one coefficient.
    pub const fn pupil(bow: bool) -> Self {
        Self { e0: true, e1: false, asymmetry: false, further: false, bow }
    }

    /// A lens with everything that lenses may have besides a radius of more terms.
    pub const fn whole(bow: bool) -> Self {
        Self { e0: true, e1: true, asymmetry: true, further: false, bow }
    }

    /// The parameters adjusted at the end.
    pub fn free(self) -> Vec<usize> {
        let has = |parameter: usize| match parameter {
            E0 => self.e0,
            E1 => self.e1,
            LENS.. => self.bow,
            K5 | K6 => self.further,
            other => other < CENTRAL || self.asymmetry,
        };
        (0..SHARED).filter(|&parameter| has(parameter)).collect()
    }
}

/// Robust adjustment from the best of `starts` (ordered best first): each is tried with few parameters, and the one of
/// least cost is refined.
pub(super) fn robust_fit(views: &[ObservedView], starts: &[Start]) -> Option<State> {
    /// Starts whose median residual is within this factor of the first one's are tried.
    const COMPARABLE: f64 = 2.0;
    let limit = COMPARABLE * starts.first()?.median_px;
    let tried = starts.iter().filter(|start| start.median_px <= limit).filter_map(|start| {
        let poses = start.poses.iter().map(|pose| pose.unwrap_or_else(ahead)).collect();
        let state = robust_stage(views, State { shared: Shared::flat(start.lens), poses }, &FEW, 10)?;
        let cost = of_corners(views, &state, Shared::residual_px).map(|d| COMPARED.cost(d * d)).sum::<f64>();
        cost.is_finite().then_some((cost, state))
    });
    let (_, state) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let state = robust_stage(views, state, &CENTRAL_LENS, 10)?;
    robust_stage(views, state, &CENTRAL_LENS, 30)
}

/// Loss for comparing starts: the cost of an outlier grows only logarithmically.
const COMPARED: Loss = Loss::Cauchy(1.0);

/// Adjusts the parameters in `free` and the poses with a loss scaled to the current residuals.
fn robust_stage(views: &[ObservedView], state: State, free: &[usize], iterations: usize) -> Option<State> {
    /// Cauchy's loss is 95 % efficient for Gaussian noise at 2.4 σ, which is 2 median distances.
    const MEDIANS: f64 = 2.0;
    let loss = Loss::Cauchy(MEDIANS * scale(views, &state)?);
    let references: Vec<_> = views.iter().collect();
    let options = SchurOptions { loss, iterations, relative_cost: 1e-5, ..SchurOptions::default() };
    let solution = solve(&Bundle::of(&references, free), state.shared, state.poses, &options);
    let mut state = State { shared: solution.shared, poses: solution.blocks };
    reconsider_poses(views, &mut state, loss);
    Some(state)
}

/// Starting pose of a target whose corners gave no linear pose.
fn ahead() -> Isometry3<f64> {
    const RANGE_MM: f64 = 500.0;
    Isometry3::translation(0.0, 0.0, RANGE_MM)
}

/// `measure` of every corner.
fn of_corners<'a>(
    views: &'a [ObservedView],
    state: &'a State,
    measure: impl Fn(&Shared, &Isometry3<f64>, &Observation) -> f64 + Copy + 'a,
) -> impl Iterator<Item = f64> + 'a {
    let of_view = move |(view, pose): (&'a ObservedView, &'a Isometry3<f64>)| {
        view.observations.iter().map(move |observation| measure(&state.shared, pose, observation))
    };
    views.iter().zip(&state.poses).flat_map(of_view)
}

/// Median deviation over all corners.
fn scale(views: &[ObservedView], state: &State) -> Option<f64> {
    Some(median(deviations(views, state))?.max(FINEST)).filter(|scale| scale.is_finite())
}

/// Gives each target the mirrored tilt if that fits better: it is another local optimum of a plane's pose (D.
/// Oberkampf, D. DeMenthon and L. Davis, CVIU 63(3), 1996).
fn reconsider_poses(views: &[ObservedView], state: &mut State, loss: Loss) {
    let shared = state.shared;
    state.poses =
        views.par_iter().zip(&state.poses).map(|(view, pose)| better_pose(&shared, view, pose, loss)).collect();
}

fn better_pose(shared: &Shared, view: &ObservedView, pose: &Isometry3<f64>, loss: Loss) -> Isometry3<f64> {
    let cost = |pose: &Isometry3<f64>| {
        view.observations.iter().map(|s| 0.5 * loss.cost(shared.deviation(pose, s).powi(2))).sum::<f64>()
    };
    let options = SchurOptions { loss, iterations: 15, relative_cost: 1e-4, ..SchurOptions::default() };
    let other = solve(&Bundle::of(&[view], &[]), *shared, vec![mirrored(pose, view)], &options);
    match other.blocks.first() {
        Some(other_pose) if other.cost < cost(pose) => *other_pose,
        _ => *pose,
    }
}

/// `pose` with the target's normal mirrored at the line of sight to its middle.
fn mirrored(pose: &Isometry3<f64>, view: &ObservedView) -> Isometry3<f64> {
    let sum =
        view.observations.iter().fold(Vector3::zeros(), |sum, s| sum + Vector3::new(s.target[0], s.target[1], 0.0));
    let middle = sum / view.observations.len() as f64;
    let seen = pose.rotation * middle + pose.translation.vector;
    let Some(sight) = seen.try_normalize(0.0) else { return *pose };
    let normal = pose.rotation * Vector3::z();
    let turned = sight * (2.0 * normal.dot(&sight)) - normal;
    let turn = UnitQuaternion::rotation_between(&normal, &turned).unwrap_or_default();
    let rotation = turn * pose.rotation;
    Isometry3::from_parts(Translation3::from(seen - rotation * middle), rotation)
}

impl State {
    /// With zero for what lens and target do not have where only these parameters are adjusted.
    pub fn with_only(mut self, free: &[usize]) -> Self {
        let mut values = self.shared.to_array();
        (0..SHARED).filter(|parameter| !free.contains(parameter)).for_each(|parameter| values[parameter] = 0.0);
        let [lens @ .., warp_x, warp_y] = values;
        self.shared = Shared { lens: LensParameters::from_array(lens), warp_mm: [warp_x, warp_y] };
        self
    }
}

impl Adjusted {
    /// Where another adjustment of the same views may start.
    pub fn state(&self) -> State {
        State { shared: self.shared, poses: self.poses.clone() }
    }

    /// This adjustment of views that an `earlier` one left: what that one dropped stays dropped.
    pub fn after(self, earlier: &Self) -> Self {
        let outliers = earlier.outliers.iter().copied().chain(self.outliers).collect();
        Self { outliers, ..self }
    }
}

/// Of fits that may be the result: their last steps are far below the standard deviations.
pub(super) const EXACT: SchurOptions = SchurOptions { iterations: 200, ..SchurOptions::near() };
/// Of fits that are judged, or from which others start: what is left of chi-squared is below a hundredth.
pub(super) const NEAR: SchurOptions = SchurOptions { relative_cost: 1e-6, ..EXACT };

/// Plain least squares over the corners near their reprojections, repeated until the set of corners stays the same. `free` are the
/// parameters adjusted; `prior` is how what is known of lenses before any view weighs.
pub(super) fn inlier_fit(
    mut views: Vec<ObservedView>,
    mut state: State,
    free: Vec<usize>,
    prior: Option<Prior>,
    (options, arrow): (&IntrinsicsOptions, &SchurOptions),
) -> Result<Adjusted, IntrinsicsError> {
    const ROUNDS: usize = 10;
    let mut left_out = Vec::new();
    let (mut normal, mut strength) = (None, None);
    for _ in 0..ROUNDS {
        let deviations = deviations(&views, &state);
        let changed = options.outlier_factor.is_some_and(|factor| flag(&mut views, &deviations, factor));
        if !changed && normal.is_some() {
            break;
        }
        let deviations = match drop_views(&mut views, &mut state, &mut left_out)? {
            true => self::deviations(&views, &state),
            false => deviations,
        };
        let references: Vec<_> = views.iter().collect();
        strength = prior.and_then(|prior| prior.strength(&views, &deviations));
        let problem = Bundle { prior: strength, ..Bundle::of(&references, &free) };
        let solution = solve(&problem, state.shared, state.poses, arrow);
        if matches!(solution.ending, Ending::Iterations | Ending::NotFinite) {
            return Err(IntrinsicsError::NotConverged);
        }
        state = State { shared: solution.shared, poses: solution.blocks };
        normal = Some(solution.normal);
    }
    let normal = normal.ok_or(IntrinsicsError::NotConverged)?;
    let (prior_factor, State { shared, poses }) = (prior.map_or(1.0, Prior::factor), state);
    Ok(Adjusted { shared, views, poses, free, normal, strength, prior_factor, outliers: left_out })
}

/// Deviations of all corners, in their order.
pub(super) fn deviations(views: &[ObservedView], state: &State) -> Vec<f64> {
    of_corners(views, state, Shared::deviation).collect()
}

/// Median deviation of the corners used.
pub(super) fn median_of_used(views: &[ObservedView], deviations: &[f64]) -> Option<f64> {
    let corners = views.iter().flat_map(|view| &view.observations).zip(deviations);
    median(corners.filter(|(corner, _)| corner.used).map(|(_, deviation)| *deviation).collect())
}

/// Flags the corners to use: those within `factor` median deviations of the used ones. Returns whether any flag
/// changed.
fn flag(views: &mut [ObservedView], deviations: &[f64], factor: f64) -> bool {
    let Some(median) = median_of_used(views, deviations) else { return false };
    let limit = factor * median.max(FINEST);
    let mut changed = false;
    for (corner, deviation) in views.iter_mut().flat_map(|view| &mut view.observations).zip(deviations) {
        let used = *deviation < limit;
        changed |= used != corner.used;
        corner.used = used;
    }
    changed
}

/// Removes views with most corners unused: they contradict the lens. Whether there were any.
fn drop_views(
    views: &mut Vec<ObservedView>,
    state: &mut State,
    left_out: &mut Vec<Outlier>,
) -> Result<bool, IntrinsicsError> {
    let agrees = |view: &ObservedView| {
        let used = view.used().count();
        used >= FEWEST_CORNERS && 2 * used > view.observations.len()
    };
    let given = views.len();
    let (mut kept, mut poses) = (Vec::with_capacity(given), Vec::with_capacity(given));
    for (view, pose) in views.drain(..).zip(&state.poses) {
        if agrees(&view) {
            kept.push(view);
            poses.push(*pose);
        } else {
            let reason = OutlierReason::ViewDisagrees;
            let outlier = |observation: &Observation| Outlier {
                view: view.index,
                corner: observation.index,
                residual_px: Some(state.shared.residual_px(pose, observation)).filter(|r| r.is_finite()),
                reason,
            };
            left_out.extend(view.observations.iter().map(outlier));
        }
    }
    (*views, state.poses) = (kept, poses);
    if views.len() < FEWEST_VIEWS {
        return Err(IntrinsicsError::ViewsDisagree { views: views.len(), needed: FEWEST_VIEWS });
    }
    Ok(views.len() < given)
}
