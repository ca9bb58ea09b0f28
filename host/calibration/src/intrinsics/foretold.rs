//! The optimum with other unknowns or another prior, as the equations of a fit that is made foretell it.

use nalgebra::{DVector, SVector};

use super::adjust::{Adjusted, State, Terms};
use super::bundle::{Bundle, Shared};
use super::observations::ObservedView;
use super::prior::Strength;
use crate::Loss;
use crate::reprojection::POSE;
use crate::schur_lm::{SchurNormal, SchurProblem, Step, common};

/// The equations of a problem, where they were made.
pub(super) struct Linear<'a> {
    pub shared: &'a Shared,
    pub poses: &'a [nalgebra::Isometry3<f64>],
    /// The parameters adjusted.
    pub free: &'a [usize],
    pub normal: &'a SchurNormal<POSE>,
}

/// The equations of another problem and the step to its optimum.
pub(super) struct Foretold {
    /// Without what the other problem does not adjust.
    pub start: State,
    pub normal: SchurNormal<POSE>,
    step: Step<POSE>,
    /// Whether lens and target lose something by that.
    is_moved: bool,
}

impl Adjusted {
    /// Its equations.
    pub fn linear(&self) -> Linear<'_> {
        Linear { shared: &self.shared, poses: &self.poses, free: &self.free, normal: &self.normal }
    }

    /// Whether another one used the same corners.
    pub fn uses_corners_of(&self, other: &Self) -> bool {
        let used = |views: &[ObservedView]| -> Vec<_> {
            let of_view = |view: &ObservedView| view.used().map(|corner| corner.index).collect();
            views.iter().map(|view| (view.index, of_view(view))).collect::<Vec<(usize, Vec<usize>)>>()
        };
        used(&self.views) == used(&other.views)
    }
}

impl Linear<'_> {
    /// Where a fit of `terms` to the same `views` starts best.
    pub fn start(&self, views: &[ObservedView], terms: Terms, prior: Option<Strength>) -> State {
        let (free, references): (_, Vec<_>) = (terms.free(), views.iter().collect());
        let problem = Bundle { prior, ..Bundle::of(&references, &free) };
        let as_it_is = || State { shared: *self.shared, poses: self.poses.to_vec() }.with_only(&free);
        self.foretold(&problem).map_or_else(as_it_is, |foretold| foretold.state(&problem))
    }

    /// `None` where the problem has other views, more unknowns, or no step.
    pub fn foretold(&self, problem: &Bundle<'_>) -> Option<Foretold> {
        if problem.views.len() != self.poses.len() {
            return None;
        }
        let place = |parameter: &usize| self.free.iter().position(|free| free == parameter);
        let kept = problem.free.iter().map(place).collect::<Option<Vec<_>>>()?;
        let values = self.shared.to_array();
        let lost = |(place, &parameter): (usize, &usize)| if kept.contains(&place) { 0.0 } else { -values[parameter] };
        let moved = DVector::from_iterator(self.free.len(), self.free.iter().enumerate().map(lost));
        let start = State { shared: *self.shared, poses: self.poses.to_vec() }.with_only(problem.free);
        let common = common(problem, &start.shared, Loss::Squares);
        let normal = self.normal.of_unknowns(&kept, (&moved, &vec![SVector::zeros(); self.poses.len()]), &common);
        Some(Foretold { step: normal.step()?, start, normal, is_moved: moved.iter().any(|by| *by != 0.0) })
    }
}

impl Foretold {
    /// Whether the start is the optimum: no step lowers the cost by more than this share of it.
    pub fn is_at_rest(&self, relative_cost: f64) -> bool {
        !self.is_moved && self.step.predicted <= relative_cost * self.normal.cost()
    }

    /// The decrease of the cost by the step.
    pub fn promised(&self) -> f64 {
        self.step.predicted
    }

    /// The equations at [`Self::state`], without a residual being evaluated.
    pub fn equations(&self, problem: &Bundle<'_>, state: &State) -> SchurNormal<POSE> {
        let kept: Vec<_> = (0..problem.free.len()).collect();
        let common = common(problem, &state.shared, Loss::Squares);
        self.normal.of_unknowns(&kept, (&self.step.shared, &self.step.blocks), &common)
    }

    /// The optimum, nearly.
    pub fn state(&self, problem: &Bundle<'_>) -> State {
        let poses = self.start.poses.iter().zip(&self.step.blocks).map(|(pose, step)| problem.block_plus(pose, step));
        State { shared: problem.shared_plus(&self.start.shared, self.step.shared.as_slice()), poses: poses.collect() }
    }
}
