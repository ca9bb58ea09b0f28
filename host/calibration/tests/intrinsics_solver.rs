//! The arrow-shaped solver against dense algebra, and the robust losses.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use nalgebra::{DMatrix, DVector, SVector};
use proptest::prelude::*;
use vergence_calibration::Loss;
use vergence_calibration::schur_lm::{Ending, Equations, SchurOptions, SchurProblem, linearise, solve};
use vergence_vision::median;

const SHARED: usize = 4;
const BLOCK: usize = 3;

/// A linear problem: residual = row · (shared, block) − value; pairs of rows count together.
#[derive(Debug)]
struct Linear {
    /// For each block its rows of SHARED + BLOCK coefficients and the value.
    blocks: Vec<Vec<[f64; SHARED + BLOCK + 1]>>,
}

impl SchurProblem<BLOCK> for Linear {
    type Shared = [f64; SHARED];
    type Block = SVector<f64, BLOCK>;

    fn shared_dimension(&self) -> usize {
        SHARED
    }

    fn block_residuals(&self, shared: &[f64; SHARED], i: usize, block: &Self::Block, equations: &mut Equations<BLOCK>) {
        for rows in self.blocks[i].chunks_exact(2) {
            let of = |row: &[f64; SHARED + BLOCK + 1]| {
                let unknowns = shared.iter().chain(block.iter());
                row.iter().zip(unknowns).map(|(a, x)| a * x).sum::<f64>() - row[SHARED + BLOCK]
            };
            let by_shared: [[f64; 2]; SHARED] = std::array::from_fn(|j| [rows[0][j], rows[1][j]]);
            let by_block: [[f64; 2]; BLOCK] = std::array::from_fn(|j| [rows[0][SHARED + j], rows[1][SHARED + j]]);
            equations.add(&[of(&rows[0]), of(&rows[1])], 1.0, &by_shared, &by_block);
        }
    }

    fn shared_residuals(&self, shared: &[f64; SHARED], equations: &mut Equations<BLOCK>) {
        // A prior on the first unknown: x0 = 1 with σ = 1/2.
        equations.add_plain(&[2.0 * (shared[0] - 1.0)], &[[2.0]], &[[0.0]; BLOCK]);
    }

    fn shared_plus(&self, shared: &[f64; SHARED], step: &[f64]) -> [f64; SHARED] {
        std::array::from_fn(|i| shared[i] + step[i])
    }

    fn block_plus(&self, block: &Self::Block, step: &SVector<f64, BLOCK>) -> Self::Block {
        block + step
    }
}

impl Linear {
    /// All rows of all blocks and the prior as one dense system.
    fn dense(&self) -> (DMatrix<f64>, DVector<f64>) {
        let width = SHARED + BLOCK * self.blocks.len();
        let mut rows = vec![{
            let mut prior = vec![0.0; width + 1];
            (prior[0], prior[width]) = (2.0, 2.0);
            prior
        }];
        for (i, row) in self.blocks.iter().enumerate().flat_map(|(i, block)| block.iter().map(move |row| (i, row))) {
            let mut wide = vec![0.0; width + 1];
            wide[..SHARED].copy_from_slice(&row[..SHARED]);
            wide[SHARED + BLOCK * i..][..BLOCK].copy_from_slice(&row[SHARED..SHARED + BLOCK]);
            wide[width] = row[SHARED + BLOCK];
            rows.push(wide);
        }
        let matrix = DMatrix::from_fn(rows.len(), width, |i, j| rows[i][j]);
        (matrix, DVector::from_fn(rows.len(), |i, _| rows[i][width]))
    }
}

fn linear() -> impl Strategy<Value = Linear> {
    let row = prop::array::uniform8(-1.0..1.0);
    prop::collection::vec(prop::collection::vec(row, 12), 2..5).prop_map(|blocks| Linear { blocks })
}

proptest! {
    #[test]
    fn solution_and_covariance_are_those_of_the_dense_system(problem in linear()) {
        let (matrix, right) = problem.dense();
        let information = matrix.transpose() * &matrix;
        // Random rows are rarely ill-conditioned; where they are, digits are lost on both sides.
        prop_assume!(information.symmetric_eigenvalues().min() > 1e-2);
        let covariance = information.try_inverse().unwrap();
        let expected = &covariance * matrix.transpose() * &right;
        let count = problem.blocks.len();

        let options = SchurOptions { gradient_cosine: 1e-12, ..SchurOptions::default() };
        let found = solve(&problem, [0.3; SHARED], vec![SVector::repeat(0.2); count], &options);
        for i in 0..SHARED {
            prop_assert!((found.shared[i] - expected[i]).abs() < 1e-6);
        }
        let shared = found.normal.shared_covariance().unwrap();
        prop_assert!((&shared - covariance.view((0, 0), (SHARED, SHARED))).amax() < 1e-8);
        for (i, block) in found.blocks.iter().enumerate() {
            let at = SHARED + BLOCK * i;
            prop_assert!((block - expected.fixed_rows::<BLOCK>(at)).amax() < 1e-6);
            let marginal = found.normal.block_covariance(i, &shared).unwrap();
            prop_assert!((marginal - covariance.fixed_view::<BLOCK, BLOCK>(at, at)).amax() < 1e-8);
            let cross = found.normal.cross_covariance(i, &shared).unwrap();
            prop_assert!((cross - covariance.view((0, at), (SHARED, BLOCK))).amax() < 1e-8);
        }
        let residual = &matrix * &expected - &right;
        prop_assert!((found.cost - 0.5 * residual.norm_squared()).abs() < 1e-9);
        let freedom = (matrix.nrows() - matrix.ncols()) as f64;
        prop_assert!((found.normal.variance().unwrap() - residual.norm_squared() / freedom).abs() < 1e-8);
    }

    #[test]
    fn a_loss_weighs_with_its_derivative(s in 1e-6..1e4_f64, scale in 0.1..10.0) {
        for loss in [Loss::Squares, Loss::Huber(scale), Loss::Cauchy(scale), Loss::GemanMcClure(scale)] {
            let h = 1e-6 * s;
            let slope = (loss.cost(s + h) - loss.cost(s - h)) / (2.0 * h);
            prop_assert!((slope - loss.weight(s)).abs() < 1e-4, "{loss:?}: {slope} {}", loss.weight(s));
            prop_assert!(loss.weight(s) <= 1.0 && loss.weight(s) > 0.0 && loss.cost(s) <= s + 1e-12);
        }
    }

    #[test]
    fn the_median_splits(values in prop::collection::vec(-1e3..1e3_f64, 1..50)) {
        let found = median(values.clone()).unwrap();
        prop_assert!(2 * values.iter().filter(|v| **v < found).count() <= values.len());
        prop_assert!(2 * values.iter().filter(|v| **v > found).count() <= values.len() + 1);
    }
}

#[test]
fn robust_loss_ignores_an_outlier() {
    // x0 measured as 1 many times (by rows that also fix the block), and once as 1000.
    let unit = |j: usize, value: f64| {
        let mut row = [0.0; SHARED + BLOCK + 1];
        (row[j], row[SHARED + BLOCK]) = (1.0, value);
        row
    };
    let mut rows: Vec<_> = (0..8).flat_map(|_| (0..SHARED + BLOCK).map(|j| unit(j, 1.0))).collect();
    rows[0] = unit(0, 1000.0);
    let problem = Linear { blocks: vec![rows] };
    let options = SchurOptions { loss: Loss::Cauchy(0.1), ..SchurOptions::default() };
    let start = || ([0.9; SHARED], vec![SVector::repeat(0.9)]);
    let robust = solve(&problem, start().0, start().1, &options);
    let plain = solve(&problem, start().0, start().1, &SchurOptions::default());
    assert!((robust.shared[0] - 1.0).abs() < 1e-3, "{:?}", robust.shared);
    assert!(plain.shared[0] > 50.0, "{:?}", plain.shared);
}

#[test]
fn undetermined_unknowns_have_no_covariance_and_stay() {
    let problem = Linear { blocks: vec![vec![[0.0, 1.0, 0.0, 0.0, 1.0, 0.5, 0.2, 2.0]; 4]] };
    let found = solve(&problem, [0.0, 0.0, 0.25, -0.5], vec![SVector::zeros()], &SchurOptions::default());
    assert_eq!(found.shared[2..].to_vec(), [0.25, -0.5]);
    assert!(found.cost < 1e-9);
    assert!(found.normal.shared_covariance().is_none());
}

#[test]
fn a_start_without_a_cost_is_said_so() {
    let problem = Linear { blocks: vec![vec![[1.0; SHARED + BLOCK + 1]; 4]] };
    let found = solve(&problem, [f64::NAN; SHARED], vec![SVector::zeros()], &SchurOptions::default());
    assert_eq!(found.ending, Ending::NotFinite);
    let normal = linearise(&problem, &[0.0; SHARED], &[SVector::zeros()], Loss::Squares);
    assert_eq!(normal.residuals(), 5);
}
