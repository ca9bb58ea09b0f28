//! Where residuals are linear in the unknowns, the equations of one fit foretell others exactly.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use nalgebra::{DVector, SVector, Vector2};

use super::super::{SchurOptions, SchurProblem, SchurSolution, common, solve};
use super::*;
use crate::Loss;

const SHARED: usize = 4;
const ROWS: u32 = 14;

/// Residuals of rows of numbers, with some of the shared unknowns adjusted, the others zero, and a prior of all that are adjusted.
struct Rows {
    free: Vec<usize>,
    /// Numbers of the views.
    views: Vec<u32>,
    prior: f64,
}

/// Numbers spread evenly from -1 to 1.
fn spread(index: u32) -> f64 {
    2.0 * (0.5 + f64::from(index) * 0.618_033_988_749_894_9).fract() - 1.0
}

impl SchurProblem<2> for Rows {
    type Shared = [f64; SHARED];
    type Block = Vector2<f64>;

    fn shared_dimension(&self) -> usize {
        self.free.len()
    }

    fn block_residuals(
        &self,
        shared: &[f64; SHARED],
        index: usize,
        block: &Vector2<f64>,
        equations: &mut Equations<2>,
    ) {
        for row in 0..ROWS {
            let number = |column: u32| spread(1 + 7 * column * column + 31 * row + 997 * self.views[index] + column);
            let by: Vec<f64> = (0..6).map(number).collect();
            let model: f64 = by.iter().zip(shared.iter().chain(block)).map(|(a, x)| a * x).sum();
            let by_shared: Vec<[f64; 1]> = self.free.iter().map(|&free| [by[free]]).collect();
            equations.add(&[model - 2.0 * number(6)], 0.5, &by_shared, &[[by[4]], [by[5]]]);
        }
    }

    fn shared_residuals(&self, shared: &[f64; SHARED], equations: &mut Equations<2>) {
        for (column, &free) in self.free.iter().enumerate() {
            let mut by = vec![[0.0]; self.free.len()];
            by[column] = [self.prior];
            equations.add_plain(&[self.prior * shared[free]], &by, &[[0.0]; 2]);
        }
    }

    fn shared_plus(&self, shared: &[f64; SHARED], step: &[f64]) -> [f64; SHARED] {
        let mut moved = *shared;
        self.free.iter().zip(step).for_each(|(&free, step)| moved[free] += step);
        moved
    }

    fn block_plus(&self, block: &Vector2<f64>, step: &Vector2<f64>) -> Vector2<f64> {
        block + step
    }
}

fn rows(free: &[usize], views: &[u32], prior: f64) -> Rows {
    Rows { free: free.to_vec(), views: views.to_vec(), prior }
}

fn fitted(problem: &Rows) -> SchurSolution<[f64; SHARED], Vector2<f64>, 2> {
    solve(problem, [0.0; SHARED], vec![Vector2::zeros(); problem.views.len()], &SchurOptions::near())
}

const VIEWS: [u32; 5] = [0, 1, 2, 3, 4];

#[test]
fn a_fit_foretells_the_one_with_fewer_unknowns_and_another_prior() {
    let whole = fitted(&rows(&[0, 1, 2, 3], &VIEWS, 0.3));
    let problem = rows(&[0, 2, 3], &VIEWS, 1.7);
    let mut shared = whole.shared;
    let moved = DVector::from_vec(vec![0.0, -shared[1], 0.0, 0.0]);
    shared[1] = 0.0;
    let still = vec![SVector::zeros(); VIEWS.len()];
    let before = whole.normal.of_unknowns(&[0, 2, 3], (&moved, &still), &common(&problem, &shared, Loss::Squares));
    let step = before.step().unwrap();
    shared = problem.shared_plus(&shared, step.shared.as_slice());
    let after = before.of_unknowns(&[0, 1, 2], (&step.shared, &step.blocks), &common(&problem, &shared, Loss::Squares));

    let expected = fitted(&problem);
    for (found, expected) in shared.iter().zip(expected.shared) {
        assert!((found - expected).abs() < 1e-7, "{shared:?} is not {expected:?}");
    }
    for (index, expected) in expected.blocks.iter().enumerate() {
        assert!((whole.blocks[index] + step.blocks[index] - expected).norm() < 1e-7);
    }
    assert!((after.cost() - expected.normal.cost()).abs() < 1e-7 * expected.cost);
    assert!((before.cost() - step.predicted - after.cost()).abs() < 1e-7 * expected.cost);
    let [found, expected] = [&after, &expected.normal].map(|normal| normal.shared_covariance().unwrap());
    assert!((found - &expected).norm() < 1e-7 * expected.norm());
    // Of residuals as small as if the views agreed less.
    let variance = 0.01 * after.variance().unwrap();
    let [scatter, clustered] = [after.scatter(variance).unwrap(), after.clustered(variance).unwrap().scatter];
    assert!(clustered > 2.0 && (scatter - clustered).abs() < 1e-7);
}

#[test]
fn a_fit_foretells_that_of_some_of_its_views_and_the_others_before_it() {
    let whole = fitted(&rows(&[0, 1, 2, 3], &VIEWS, 0.3));
    let step = whole.normal.of_blocks(|index| index % 2 == 0).step().unwrap();
    let (half, other) = (rows(&[0, 1, 2, 3], &[0, 2, 4], 0.3), rows(&[], &[3], 0.0));
    let expected = fitted(&half);
    let shared = half.shared_plus(&whole.shared, step.shared.as_slice());
    assert!(shared.iter().zip(expected.shared).all(|(found, expected)| (found - expected).abs() < 1e-7));

    let (turn, cost) = whole.normal.followed(3, &step.shared).unwrap();
    let seen = solve(&other, shared, vec![Vector2::zeros()], &SchurOptions::near());
    assert!((whole.blocks[3] + turn - seen.blocks[0]).norm() < 1e-7);
    assert!((cost - seen.cost).abs() < 1e-7 * seen.cost && seen.cost > 0.01);
}
