//! Closing a loop from a start near the answer, by Levenberg's damped Gauss-Newton steps.

use nalgebra::{DMatrix, DVector};

use super::Loop;

/// A loop counts as closed when nothing in its residual is larger: millimetres by scale, or entries of a rotation.
const CLOSED: f64 = 1e-13;
/// Steps after which a loop that does not close is given up.
const MOST_STEPS: usize = 500;
/// A residual that is not below this after the last step is no closed loop. At a dead centre the residual falls with the
/// square of the angle's error, so that a loop may be closed before its angles are found to all digits.
const TOLERATED: f64 = 1e-12;

/// Angles at which a loop is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closed<const N: usize> {
    /// All joints, in radians.
    pub angles: [f64; N],
    /// What is left of the closure, see [`Loop::closure_error`].
    pub error: f64,
}

/// The loop cannot be closed from this start.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the links do not meet: {left_mm:.3} mm are left at the best angles of the passive joints")]
pub struct CloseError {
    /// What is left at the end, in millimetres.
    pub left_mm: f64,
}

impl<const N: usize> Loop<N> {
    /// Finds angles of the joints that are not `driven` at which the loop is closed, beginning at `start`, whose driven joints
    /// stay as they are. It finds the branch that is nearest downhill: start from the last known angles to stay on a branch.
    ///
    /// # Errors
    /// [`CloseError`] where the driven joints leave no closed loop near the start.
    pub fn close(&self, start: &[f64; N], driven: &[bool; N]) -> Result<Closed<N>, CloseError> {
        let passive: Vec<usize> = (0..N).filter(|&joint| !driven[joint]).collect();
        let mut angles = *start;
        let mut residual = self.residual(&angles);
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            if residual.amax() <= CLOSED || damping > 1e12 {
                break;
            }
            let derivative = self.residual_derivative(&angles);
            let slopes = DMatrix::from_fn(12, passive.len(), |row, column| derivative[(row, passive[column])]);
            let Some(step) = damped_step(&slopes, residual.as_slice(), damping) else { break };
            let mut tried = angles;
            passive.iter().zip(step.iter()).for_each(|(&joint, by)| tried[joint] += by);
            let left = self.residual(&tried);
            if left.norm() < residual.norm() {
                (angles, residual) = (tried, left);
                damping = (damping / 10.0).max(1e-15);
            } else {
                damping *= 10.0;
            }
        }
        let error = residual.amax();
        if error <= TOLERATED {
            Ok(Closed { angles, error })
        } else {
            Err(CloseError { left_mm: residual.norm() * self.scale() })
        }
    }
}

/// The step that solves `(JᵀJ + damping) step = -Jᵀ residual`.
fn damped_step(slopes: &DMatrix<f64>, residual: &[f64], damping: f64) -> Option<DVector<f64>> {
    let residual = DVector::from_column_slice(residual);
    let transposed = slopes.transpose();
    let normal = &transposed * slopes + DMatrix::identity(slopes.ncols(), slopes.ncols()) * damping;
    Some(-normal.cholesky()?.solve(&(transposed * residual)))
}
