//! The normal equations of problems beside one that is linearised: with fewer unknowns, other priors, or some of the small blocks.
//!
//! Where the residuals are linear in what the unknowns move by, the optimum of such a problem follows from the equations of the first one,
//! without a residual being evaluated. In general its error is that of a Gauss-Newton step.

use nalgebra::{DMatrix, DVector, SVector};

use super::normal::{Part, SmallBlock};
use super::{Equations, SchurNormal, SchurOptions, Step};

impl<const B: usize> SchurNormal<B> {
    /// With only the shared unknowns `kept` (indices), after all shared unknowns moved by `moved` and each small block by its own step of
    /// `blocks`, and with the residuals `common` in place of those that depend on no small block. The residuals of the blocks are for plain
    /// least squares.
    pub(crate) fn of_unknowns(
        &self,
        kept: &[usize],
        (moved, blocks): (&DVector<f64>, &[SVector<f64, B>]),
        common: &Equations<B>,
    ) -> Self {
        let chosen = |gradient: &DVector<f64>| DVector::from_fn(kept.len(), |i, _| gradient[kept[i]]);
        let of_block = |(block, step): (&SmallBlock<B>, &SVector<f64, B>)| {
            let SmallBlock { part, matrix, gradient, coupling } = block;
            let (by_shared, by_block) =
                (&part.shared * moved + coupling * step, coupling.tr_mul(moved) + matrix * step);
            let more = (&part.shared_gradient + &by_shared * 0.5).dot(moved) + (gradient + by_block * 0.5).dot(step);
            let part = Part {
                shared: DMatrix::from_fn(kept.len(), kept.len(), |i, j| part.shared[(kept[i], kept[j])]),
                shared_gradient: chosen(&(&part.shared_gradient + by_shared)),
                cost: part.cost + more,
                squares: part.squares + 2.0 * more,
                residuals: part.residuals,
            };
            SmallBlock { part, matrix: *matrix, gradient: gradient + by_block, coupling: coupling.select_rows(kept) }
        };
        let blocks = self.blocks.iter().zip(blocks).map(of_block).collect();
        Self::from_blocks(Part::of(common, kept.len()), blocks)
    }

    /// The step to the optimum of the linear model.
    pub(crate) fn step(&self) -> Option<Step<B>> {
        self.damped_step(SchurOptions::near().damping)
    }

    /// By how much the residuals of the small blocks really cost more, which is told in `cost`, than here.
    pub(crate) fn dearer(&self, cost: f64) -> f64 {
        cost - (self.whole.cost - self.common.cost)
    }

    /// Where all of it costs so much more.
    pub(crate) fn with_more_cost(mut self, more: f64) -> Self {
        self.whole.cost += more;
        self
    }

    /// With only some of the small blocks.
    pub(crate) fn of_blocks(&self, is_chosen: impl Fn(usize) -> bool) -> Self {
        let chosen = self.blocks.iter().enumerate().filter(|(index, _)| is_chosen(*index));
        Self::from_blocks(self.common.clone(), chosen.map(|(_, block)| block.clone()).collect())
    }

    /// How small block `index` moves after the shared unknowns moved by `moved`, and the cost of its residuals then.
    pub(crate) fn followed(&self, index: usize, moved: &DVector<f64>) -> Option<(SVector<f64, B>, f64)> {
        let SmallBlock { part, matrix, gradient, coupling } = self.blocks.get(index)?;
        let gradient = gradient + coupling.tr_mul(moved);
        let step = -nalgebra::Cholesky::new(*matrix)?.solve(&gradient);
        let by_shared = part.shared_gradient.dot(moved) + 0.5 * moved.dot(&(&part.shared * moved));
        Some((step, part.cost + by_shared + 0.5 * step.dot(&gradient)))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/nearby.rs"]
mod tests;
