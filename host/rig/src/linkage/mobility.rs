//! How a loop can move, and how its passive joints follow the driven ones.

use nalgebra::{DMatrix, SMatrix};

use super::Loop;

/// Singular values below this share of the largest count as zero: closed angles are known to some 1e-8 at a dead centre.
const ZERO: f64 = 1e-6;

/// How a loop can move at a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mobility {
    /// Number of independent motions of the joints that keep the loop closed.
    pub freedom: usize,
    /// Smallest singular value of the twists of the passive joints, in radians and scales of the loop: zero where the passive
    /// joints do not follow the driven ones alone. At a distance `s`, the error of a passive joint is up to `1/s` of that
    /// of a driven one.
    pub distance_to_singularity: f64,
}

/// The passive joints do not follow the driven ones: the shape is singular, or too few joints are driven.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the passive joints do not follow the driven ones here: distance to singularity {distance:.1e}")]
pub struct NotDriven {
    /// See [`Mobility::distance_to_singularity`].
    pub distance: f64,
}

impl<const N: usize> Loop<N> {
    /// How the loop can move at a closed shape whose joints `driven` are driven, where joints of `locked` do not move at all.
    #[must_use]
    pub fn mobility(&self, angles: &[f64; N], driven: &[bool; N], locked: &[bool; N]) -> Mobility {
        let twists = self.twists(angles);
        let columns = |wanted: &dyn Fn(usize) -> bool| {
            let chosen: Vec<usize> = (0..N).filter(|&joint| wanted(joint)).collect();
            DMatrix::from_fn(6, chosen.len(), |row, column| twists[(row, chosen[column])])
        };
        let moving = columns(&|joint| !locked[joint]);
        let values = moving.singular_values();
        let rank = values.iter().filter(|&&value| value > ZERO * values.max()).count();
        let passive = columns(&|joint| !locked[joint] && !driven[joint]);
        let smallest = passive.singular_values().iter().copied().fold(f64::INFINITY, f64::min);
        Mobility { freedom: moving.ncols() - rank, distance_to_singularity: smallest }
    }

    /// Change of each joint for a change of each driven one, with the loop kept closed: row for joint, column for the driven
    /// ones in their order; columns of joints that are not driven are zero.
    ///
    /// # Errors
    /// [`NotDriven`] at a singular shape.
    pub fn following(&self, angles: &[f64; N], driven: &[bool; N]) -> Result<SMatrix<f64, N, N>, NotDriven> {
        let distance = self.mobility(angles, driven, &[false; N]).distance_to_singularity;
        let twists = self.twists(angles);
        let passive: Vec<usize> = (0..N).filter(|&joint| !driven[joint]).collect();
        let slopes = DMatrix::from_fn(6, passive.len(), |row, column| twists[(row, passive[column])]);
        if distance <= ZERO || passive.len() > 6 {
            return Err(NotDriven { distance });
        }
        let inverse = slopes.pseudo_inverse(ZERO).map_err(|_| NotDriven { distance })?;
        let mut following = SMatrix::<f64, N, N>::zeros();
        for joint in (0..N).filter(|&joint| driven[joint]) {
            following[(joint, joint)] = 1.0;
            let followed = -&inverse * twists.column(joint);
            passive.iter().zip(followed.iter()).for_each(|(&row, &by)| following[(row, joint)] = by);
        }
        Ok(following)
    }
}
