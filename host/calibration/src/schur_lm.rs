//! Levenberg-Marquardt for one shared block of unknowns and many small ones.
//!
//! In calibration every residual depends on the shared unknowns (a lens, a rig) and on those of one view (where the
//! target stood). The normal matrix then has the shape of an arrow: the views' blocks are eliminated one by one and
//! what remains is a small dense system, the Schur complement. B. Triggs et al., "Bundle Adjustment: A Modern
//! Synthesis", 1999, section 6; damping by K. Madsen, H. Nielsen and O. Tingleff, "Methods for Non-Linear Least Squares
//! Problems", 2004, section 3.2.

mod clustered;
mod nearby;
mod normal;
mod products;

use nalgebra::{DVector, SVector};
use rayon::prelude::*;

pub use clustered::Clustered;
pub use normal::{Equations, SchurNormal};

use crate::Loss;

/// A least-squares problem with a shared block of any dimension and small blocks of dimension `B`.
///
/// The unknowns may live on manifolds: the solver only steps in local coordinates, through the two `plus`, and the
/// Jacobians are with respect to those coordinates at zero.
pub trait SchurProblem<const B: usize>: Sync {
    /// The unknowns that all residuals share.
    type Shared: Clone + Send + Sync;
    /// The unknowns of one small block.
    type Block: Clone + Send + Sync;

    /// The dimension of the shared step.
    fn shared_dimension(&self) -> usize;

    /// Adds the residuals of block `index` to `equations`, always in the same order.
    fn block_residuals(&self, shared: &Self::Shared, index: usize, block: &Self::Block, equations: &mut Equations<B>);

    /// Adds the residuals that depend on no small block, such as priors and sensor readings. None by default.
    fn shared_residuals(&self, _shared: &Self::Shared, _equations: &mut Equations<B>) {}

    /// `shared` moved by `step` in its local coordinates.
    fn shared_plus(&self, shared: &Self::Shared, step: &[f64]) -> Self::Shared;

    /// `block` moved by `step` in its local coordinates.
    fn block_plus(&self, block: &Self::Block, step: &SVector<f64, B>) -> Self::Block;
}

/// Stopping criteria and loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchurOptions {
    /// Applied to every residual added with [`Equations::add`].
    pub loss: Loss,
    /// Largest number of trial steps.
    pub iterations: usize,
    /// Stop once an accepted step lowers the cost by less than this share of it.
    pub relative_cost: f64,
    /// Stop once the cosine between the residuals and every column of the Jacobian is at most this.
    pub gradient_cosine: f64,
    /// Damping of the first step, in parts of the normal matrix's diagonal. Where unknowns hardly differ in what they do, such as the
    /// coefficients of a lens, even a little damping makes many steps of one.
    pub damping: f64,
}

impl SchurOptions {
    /// The default, from a start where the linear model holds.
    pub(crate) const fn near() -> Self {
        Self { loss: Loss::Squares, iterations: 100, relative_cost: 1e-12, gradient_cosine: 1e-9, damping: 1e-10 }
    }
}

impl Default for SchurOptions {
    /// Plain least squares, iterated until steps are far below the standard deviations of the unknowns.
    fn default() -> Self {
        Self { loss: Loss::Squares, iterations: 100, relative_cost: 1e-12, gradient_cosine: 1e-9, damping: 1e-4 }
    }
}

/// Why the iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The gradient is zero to within [`SchurOptions::gradient_cosine`].
    Gradient,
    /// The last step lowered the cost by less than [`SchurOptions::relative_cost`], or the next one would.
    Cost,
    /// No step, however short, lowers the cost: an optimum to within rounding, or a wrong Jacobian.
    Stalled,
    /// [`SchurOptions::iterations`] was reached.
    Iterations,
    /// The cost at the start is not a finite number.
    NotFinite,
}

/// Result of [`solve`].
#[derive(Clone, Debug)]
pub struct SchurSolution<S, T, const B: usize> {
    /// The shared unknowns.
    pub shared: S,
    /// The small blocks, in the order given.
    pub blocks: Vec<T>,
    /// ½ Σ ρ(‖r‖²).
    pub cost: f64,
    /// Number of trial steps made.
    pub iterations: usize,
    /// Why the iteration ended.
    pub ending: Ending,
    /// The normal equations at the solution, which hold the covariance.
    pub normal: SchurNormal<B>,
}

/// Minimises ½ Σ ρ(‖r‖²) from the start given. The same arguments give the same bits, whatever the number of threads:
/// blocks are evaluated in parallel and summed in their order.
pub fn solve<const B: usize, P: SchurProblem<B>>(
    problem: &P,
    shared: P::Shared,
    blocks: Vec<P::Block>,
    options: &SchurOptions,
) -> SchurSolution<P::Shared, P::Block, B> {
    // The gain-ratio strategy of Madsen et al.: start near Gauss-Newton, back off fast after a refused step.
    const LARGEST_DAMPING: f64 = 1e16;
    let normal = linearise(problem, &shared, &blocks, options.loss);
    let mut now =
        SchurSolution { cost: normal.cost(), shared, blocks, iterations: 0, ending: Ending::NotFinite, normal };
    if !now.cost.is_finite() {
        return now;
    }
    let (mut damping, mut growth) = (options.damping, 2.0);
    now.ending = Ending::Iterations;
    while now.iterations < options.iterations {
        if now.normal.gradient_cosine() <= options.gradient_cosine {
            now.ending = Ending::Gradient;
            break;
        }
        let step = now.normal.damped_step(damping);
        let promised = step.as_ref().map_or(f64::INFINITY, |step| step.predicted);
        // Steps that were refused before, and so are short, promise little wherever they begin.
        if damping <= options.damping && promised <= options.relative_cost * now.cost {
            now.ending = Ending::Cost;
            break;
        }
        now.iterations += 1;
        match step.and_then(|step| try_step(problem, &mut now, &step, options.loss)) {
            Some(gain) => {
                damping *= (1.0 - (2.0 * gain.ratio - 1.0).powi(3)).max(1.0 / 3.0);
                growth = 2.0;
                if gain.relative <= options.relative_cost {
                    now.ending = Ending::Cost;
                    break;
                }
            }
            None => {
                damping *= growth;
                growth *= 2.0;
                if damping > LARGEST_DAMPING {
                    now.ending = Ending::Stalled;
                    break;
                }
            }
        }
    }
    now
}

/// Decrease of the cost by an accepted step.
struct Gain {
    /// Achieved decrease over the predicted one.
    ratio: f64,
    /// Decrease as a share of the cost.
    relative: f64,
}

/// Makes a step; returns `None` and leaves `now` unchanged if that does not lower the cost.
fn try_step<const B: usize, P: SchurProblem<B>>(
    problem: &P,
    now: &mut SchurSolution<P::Shared, P::Block, B>,
    step: &Step<B>,
    loss: Loss,
) -> Option<Gain> {
    let shared = problem.shared_plus(&now.shared, step.shared.as_slice());
    let blocks: Vec<_> = now.blocks.iter().zip(&step.blocks).map(|(b, d)| problem.block_plus(b, d)).collect();
    let normal = linearise(problem, &shared, &blocks, loss);
    let decrease = now.cost - normal.cost();
    if decrease.is_nan() || decrease <= 0.0 {
        return None;
    }
    let gain = Gain { ratio: (decrease / step.predicted).min(2.0), relative: decrease / now.cost };
    now.cost = normal.cost();
    (now.shared, now.blocks, now.normal) = (shared, blocks, normal);
    Some(gain)
}

/// The normal equations at `shared` and `blocks`.
pub fn linearise<const B: usize, P: SchurProblem<B>>(
    problem: &P,
    shared: &P::Shared,
    blocks: &[P::Block],
    loss: Loss,
) -> SchurNormal<B> {
    let n = problem.shared_dimension();
    let common = common(problem, shared, loss);
    let parts: Vec<_> = blocks
        .par_iter()
        .enumerate()
        .map(|(index, block)| {
            let mut equations = Equations::new(n, loss);
            problem.block_residuals(shared, index, block, &mut equations);
            equations.summed()
        })
        .collect();
    SchurNormal::from_equations(n, &common, &parts)
}

/// The residuals that depend on no small block.
pub(crate) fn common<const B: usize, P: SchurProblem<B>>(problem: &P, shared: &P::Shared, loss: Loss) -> Equations<B> {
    let mut common = Equations::new(problem.shared_dimension(), loss);
    problem.shared_residuals(shared, &mut common);
    common.summed()
}

/// A step in all local coordinates.
pub(crate) struct Step<const B: usize> {
    pub shared: DVector<f64>,
    pub blocks: Vec<SVector<f64, B>>,
    /// The decrease of the cost that the linear model promises.
    pub predicted: f64,
}
