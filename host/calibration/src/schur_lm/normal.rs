//! The normal equations in arrow form: their assembly, damped solution and covariance.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, OMatrix, SMatrix, SVector, U1};

use super::Step;
use super::products::Products;
use crate::Loss;

/// Collects the residuals of one small block into JᵀJ, Jᵀr and the cost.
pub struct Equations<const B: usize> {
    shared_dimension: usize,
    loss: Loss,
    /// [J r]ᵀ[J r] with the columns shared, block, residual.
    products: Products,
    cost: f64,
    residuals: usize,
}

impl<const B: usize> Equations<B> {
    pub(super) fn new(shared_dimension: usize, loss: Loss) -> Self {
        Self { shared_dimension, loss, products: Products::new(shared_dimension + B + 1), cost: 0.0, residuals: 0 }
    }

    /// Adds one residual of `R` components with standard deviation `sigma`; the robust loss takes them together.
    /// `shared[i]` is its derivative by the shared step's component `i` (missing ones are zero), `block[i]` by the
    /// block step's component `i`.
    pub fn add<const R: usize>(&mut self, residual: &[f64; R], sigma: f64, shared: &[[f64; R]], block: &[[f64; R]; B]) {
        let s = residual.iter().map(|r| r * r).sum::<f64>() / (sigma * sigma);
        self.cost += 0.5 * self.loss.cost(s);
        self.accumulate(residual, shared, block, self.loss.weight(s).sqrt() / sigma);
    }

    /// As [`Self::add`], with unit standard deviation and without the robust loss: for priors and sensors that have no
    /// outliers.
    pub fn add_plain<const R: usize>(&mut self, residual: &[f64; R], shared: &[[f64; R]], block: &[[f64; R]; B]) {
        self.cost += 0.5 * residual.iter().map(|r| r * r).sum::<f64>();
        self.accumulate(residual, shared, block, 1.0);
    }

    fn accumulate<const R: usize>(
        &mut self,
        residual: &[f64; R],
        shared: &[[f64; R]],
        block: &[[f64; R]; B],
        weight: f64,
    ) {
        self.residuals += R;
        for component in 0..R {
            let (of_shared, rest) = self.products.row().split_at_mut(self.shared_dimension);
            let (of_block, of_residual) = rest.split_at_mut(B);
            for (slot, column) in of_shared.iter_mut().zip(shared) {
                *slot = weight * column[component];
            }
            for (slot, column) in of_block.iter_mut().zip(block) {
                *slot = weight * column[component];
            }
            of_residual[0] = weight * residual[component];
        }
    }

    /// With all residuals counted.
    pub(super) fn summed(mut self) -> Self {
        self.products.sum();
        self
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.products.at(i, j)
    }
}

/// n × B.
type Coupling<const B: usize> = OMatrix<f64, Dyn, nalgebra::Const<B>>;

/// The normal equations at one point: the shared block, every small block, and their couplings.
#[derive(Clone, Debug)]
pub struct SchurNormal<const B: usize> {
    /// Of all residuals.
    pub(super) whole: Part,
    /// Of those that depend on no small block.
    pub(super) common: Part,
    pub(super) blocks: Vec<SmallBlock<B>>,
}

/// What residuals add to the shared block, its gradient and the cost.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub shared: DMatrix<f64>,
    pub shared_gradient: DVector<f64>,
    pub cost: f64,
    pub residuals: usize,
    pub squares: f64,
}

#[derive(Clone, Debug)]
pub(super) struct SmallBlock<const B: usize> {
    pub part: Part,
    pub matrix: SMatrix<f64, B, B>,
    pub gradient: SVector<f64, B>,
    pub coupling: Coupling<B>,
}

impl Part {
    pub fn of<const B: usize>(equations: &Equations<B>, n: usize) -> Self {
        let last = n + B;
        Self {
            shared: DMatrix::from_fn(n, n, |i, j| equations.at(i, j)),
            shared_gradient: DVector::from_fn(n, |i, _| equations.at(i, last)),
            cost: equations.cost,
            residuals: equations.residuals,
            squares: equations.at(last, last),
        }
    }

    /// Information and gradient of the shared unknowns, less what small blocks have `taken` of them by their own.
    fn less(&self, taken: &Products) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.shared.nrows();
        let information = DMatrix::from_fn(n, n, |i, j| self.shared[(i, j)] - taken.at(i, j));
        (information, DVector::from_fn(n, |i, _| self.shared_gradient[i] - taken.at(i, n)))
    }

    fn add(&mut self, other: &Self) {
        self.shared += &other.shared;
        self.shared_gradient += &other.shared_gradient;
        self.cost += other.cost;
        self.residuals += other.residuals;
        self.squares += other.squares;
    }
}

impl<const B: usize> SmallBlock<B> {
    fn of(equations: &Equations<B>, n: usize) -> Self {
        let last = n + B;
        Self {
            part: Part::of(equations, n),
            matrix: SMatrix::from_fn(|i, j| equations.at(n + i, n + j)),
            gradient: SVector::from_fn(|i, _| equations.at(n + i, last)),
            coupling: Coupling::from_fn_generic(Dyn(n), nalgebra::Const::<B>, |i, j| equations.at(i, n + j)),
        }
    }

    /// Adds rows whose products are C M⁻¹ Cᵀ and C M⁻¹ g: what the shared block and its gradient lose when this block, of matrix M, coupling C
    /// and gradient g, is eliminated. `factor` is that of M.
    fn eliminate(&self, factor: &Cholesky<f64, nalgebra::Const<B>>, rows: &mut Products) -> Option<()> {
        let n = self.coupling.nrows();
        let triangle = factor.l_dirty();
        let mut columns = self.coupling.clone();
        let mut gradient = self.gradient;
        // Forward substitution, of all unknowns at once.
        for i in 0..B {
            for j in 0..i {
                let (share, solved) = (triangle[(i, j)], gradient[j]);
                let (before, mut now) = columns.columns_range_pair_mut(j, i);
                now.axpy(-share, &before, 1.0);
                gradient[i] -= share * solved;
            }
            let over = 1.0 / triangle[(i, i)];
            columns.column_mut(i).scale_mut(over);
            gradient[i] *= over;
            let row = rows.row();
            row[..n].copy_from_slice(columns.column(i).as_slice());
            row[n] = gradient[i];
        }
        gradient.iter().all(|value| value.is_finite()).then_some(())
    }
}

impl<const B: usize> SchurNormal<B> {
    pub(super) fn from_equations(n: usize, common: &Equations<B>, parts: &[Equations<B>]) -> Self {
        Self::from_blocks(Part::of(common, n), parts.iter().map(|part| SmallBlock::of(part, n)).collect())
    }

    pub(super) fn from_blocks(common: Part, blocks: Vec<SmallBlock<B>>) -> Self {
        let mut whole = common.clone();
        blocks.iter().for_each(|block| whole.add(&block.part));
        Self { whole, common, blocks }
    }

    pub(super) const fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// The information and the gradient of the shared unknowns by small block `index` alone, its own unknowns eliminated. `None`
    /// where it is singular.
    pub(super) fn eliminated(&self, index: usize) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let block = self.blocks.get(index)?;
        let (part, n) = (&block.part, block.part.shared.nrows());
        let mut taken = Products::new(n + 1);
        block.eliminate(&Cholesky::new(block.matrix)?, &mut taken)?;
        taken.sum();
        Some(part.less(&taken))
    }

    /// ½ Σ ρ(‖r‖²).
    #[must_use]
    pub const fn cost(&self) -> f64 {
        self.whole.cost
    }

    /// The number of residual components.
    #[must_use]
    pub const fn residuals(&self) -> usize {
        self.whole.residuals
    }

    /// The estimated variance of one residual component, Σ r² over the degrees of freedom (residuals less unknowns),
    /// after the robust weights; `None` without redundancy.
    #[must_use]
    pub fn variance(&self) -> Option<f64> {
        let unknowns = self.whole.shared.nrows() + B * self.blocks.len();
        let freedom = self.whole.residuals.checked_sub(unknowns).filter(|&f| f > 0)?;
        Some(self.whole.squares / freedom as f64)
    }

    /// The largest cosine between a column of the Jacobian and the residuals: zero at a minimum.
    pub(super) fn gradient_cosine(&self) -> f64 {
        let length = self.whole.squares.sqrt();
        let cosine = |gradient: f64, square: f64| {
            if square > 0.0 && length > 0.0 { gradient.abs() / (square.sqrt() * length) } else { 0.0 }
        };
        let shared = self
            .whole
            .shared_gradient
            .iter()
            .zip(self.whole.shared.diagonal().iter())
            .map(|(&g, &s)| cosine(g, s))
            .fold(0.0, f64::max);
        let block = |b: &SmallBlock<B>| (0..B).map(|i| cosine(b.gradient[i], b.matrix[(i, i)])).fold(0.0, f64::max);
        self.blocks.iter().map(block).fold(shared, f64::max)
    }

    /// The minimiser of the linear model plus ½ damping Σ Dᵢδᵢ², D the normal matrix's diagonal (Marquardt, 1963).
    pub(super) fn damped_step(&self, damping: f64) -> Option<Step<B>> {
        let reduced = self.reduce(damping)?;
        let shared = reduced.shared.as_ref().map_or_else(|| DVector::zeros(0), |s| s.solve(&-reduced.gradient));
        let blocks: Vec<_> = self
            .blocks
            .iter()
            .zip(&reduced.blocks)
            .map(|(block, factor)| -factor.solve(&(block.gradient + block.coupling.transpose() * &shared)))
            .collect();
        let term = |d: f64, g: f64, diagonal: f64| 0.5 * d * (damping * damped_diagonal(diagonal) * d - g);
        let mut predicted: f64 =
            (0..shared.len()).map(|i| term(shared[i], self.whole.shared_gradient[i], self.whole.shared[(i, i)])).sum();
        for (step, block) in blocks.iter().zip(&self.blocks) {
            predicted += (0..B).map(|i| term(step[i], block.gradient[i], block.matrix[(i, i)])).sum::<f64>();
        }
        Some(Step { shared, blocks, predicted })
    }

    /// The information of the shared unknowns after the small blocks are eliminated: the Schur complement. Its inverse
    /// is [`Self::shared_covariance`]. `None` where a small block is singular.
    #[must_use]
    pub fn shared_information(&self) -> Option<DMatrix<f64>> {
        let n = self.whole.shared.nrows();
        let mut taken = Products::new(n + 1);
        for block in &self.blocks {
            block.eliminate(&Cholesky::new(block.matrix)?, &mut taken)?;
        }
        taken.sum();
        Some(self.whole.less(&taken).0)
    }

    /// The marginal covariance of the shared step for unit variance of a residual component: multiply by
    /// [`Self::variance`]. `None` where the unknowns are not determined.
    #[must_use]
    pub fn shared_covariance(&self) -> Option<DMatrix<f64>> {
        invert_scaled(&self.shared_information()?)
    }

    /// The marginal covariance of small block `index`, in its local coordinates, given [`Self::shared_covariance`].
    #[must_use]
    pub fn block_covariance(&self, index: usize, shared_covariance: &DMatrix<f64>) -> Option<SMatrix<f64, B, B>> {
        let block = self.blocks.get(index)?;
        let factor = Cholesky::new(block.matrix)?;
        let gain: Coupling<B> = factor.solve(&block.coupling.transpose()).transpose();
        Some(factor.inverse() + gain.transpose() * shared_covariance * gain)
    }

    /// The covariance between the shared step (rows) and small block `index` (columns).
    #[must_use]
    pub fn cross_covariance(&self, index: usize, shared_covariance: &DMatrix<f64>) -> Option<Coupling<B>> {
        let block = self.blocks.get(index)?;
        Some(-shared_covariance * Cholesky::new(block.matrix)?.solve(&block.coupling.transpose()).transpose())
    }

    fn reduce(&self, damping: f64) -> Option<Reduced<B>> {
        let n = self.whole.shared.nrows();
        let mut taken = Products::new(n + 1);
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut matrix = block.matrix;
            (0..B).for_each(|i| matrix[(i, i)] += damping * damped_diagonal(block.matrix[(i, i)]));
            let factor = Cholesky::new(matrix)?;
            if n > 0 {
                block.eliminate(&factor, &mut taken)?;
            }
            blocks.push(factor);
        }
        taken.sum();
        let (mut schur, gradient) = self.whole.less(&taken);
        (0..n).for_each(|i| schur[(i, i)] += damping * damped_diagonal(self.whole.shared[(i, i)]));
        let shared = if n > 0 { Some(Cholesky::new(schur)?) } else { None };
        Some(Reduced { shared, gradient, blocks })
    }
}

struct Reduced<const B: usize> {
    shared: Option<Cholesky<f64, Dyn>>,
    gradient: DVector<f64>,
    blocks: Vec<Cholesky<f64, nalgebra::Const<B>>>,
}

/// An unknown that no residual depends on keeps its value; its diagonal of 1 keeps the damped matrix regular.
fn damped_diagonal(diagonal: f64) -> f64 {
    if diagonal > 0.0 { diagonal } else { 1.0 }
}

/// Inverse of a symmetric positive definite matrix whose rows may have very different units; `None` if it is singular.
fn invert_scaled(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let scale: OMatrix<f64, Dyn, U1> = matrix.diagonal().map(|d| 1.0 / d.sqrt());
    if n == 0 || !scale.iter().all(|s| s.is_finite()) {
        return (n == 0).then(|| matrix.clone());
    }
    let unit = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = determined(unit)?.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// The factor of an information with ones on its diagonal; `None` where only rounding parts it from a singular one. The square of an element on
/// the factor's diagonal is the part of an unknown that those before it do not tell: rounding leaves some 1e-15 of it where they tell all.
pub(super) fn determined(unit: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    const SINGULAR: f64 = 1e-12;
    let factor = Cholesky::new(unit)?;
    let is_told = factor.l_dirty().diagonal().iter().all(|own| own * own > SINGULAR);
    is_told.then_some(factor)
}
