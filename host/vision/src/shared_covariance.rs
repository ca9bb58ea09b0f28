//! The covariance of what all points of a pair share: lenses and pose.

use multiversion::multiversion;
use nalgebra::{Matrix6, SMatrix};

use crate::lens_derivatives::LENS_PARAMETERS;

/// Number of parameters that all points of a pair share: those of both lenses and the six of the pose.
pub const SHARED_PARAMETERS: usize = 2 * LENS_PARAMETERS + 6;
/// The first parameter of the pose.
const POSE: usize = 2 * LENS_PARAMETERS;

/// The covariance of all shared parameters.
type Covariance = SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>;
/// A number for each shared parameter.
type OfEach<T> = [T; SHARED_PARAMETERS];

/// The covariance (38 × 38) of the parameters that all points of a pair share.
///
/// Their order is: left lens, right lens (each in the order of [`LENS_PARAMETERS`]), then the relative pose as a turn ω about the left axes
/// in radians and a shift δ of the right camera in the left frame in millimetres: R ← exp(ω) R, t ← t + δ. Rows and columns of parameters
/// that are exact, such as those that a lens does not have, are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedCovariance {
    matrix: Covariance,
    /// The matrix row by row.
    rows: OfEach<OfEach<f64>>,
    /// The parameters that are not exact, and how many they are.
    unknown: (OfEach<usize>, usize),
}

impl SharedCovariance {
    /// The zero covariance, of lenses and pose that are known exactly.
    #[must_use]
    pub fn exact() -> Self {
        Self::joint(SMatrix::zeros())
    }

    /// The full covariance of lenses and pose that were calibrated together, with all correlations.
    #[must_use]
    pub fn joint(covariance: Covariance) -> Self {
        let (mut unknown, mut count) = ([0; SHARED_PARAMETERS], 0);
        for parameter in (0..SHARED_PARAMETERS).filter(|&i| covariance[(i, i)] != 0.0) {
            unknown[count] = parameter;
            count += 1;
        }
        Self { matrix: covariance, rows: covariance.transpose().into(), unknown: (unknown, count) }
    }

    /// Replaces the covariance of the pose (6 × 6) and removes its correlation with the lenses.
    #[must_use]
    pub fn with_pose(self, covariance: &Matrix6<f64>) -> Self {
        let mut matrix = self.matrix;
        matrix.fixed_columns_mut::<6>(POSE).fill(0.0);
        matrix.fixed_rows_mut::<6>(POSE).fill(0.0);
        matrix.fixed_view_mut::<6, 6>(POSE, POSE).copy_from(covariance);
        Self::joint(matrix)
    }

    /// Adds a covariance (6 × 6) to that of the pose, of errors that are independent of all others.
    #[must_use]
    pub fn plus_pose(self, covariance: &Matrix6<f64>) -> Self {
        let mut matrix = self.matrix;
        let mut pose = matrix.fixed_view_mut::<6, 6>(POSE, POSE);
        pose += covariance;
        Self::joint(matrix)
    }

    /// The covariance (6 × 6) of the pose: turn ω and shift δ.
    #[must_use]
    pub fn pose(&self) -> Matrix6<f64> {
        self.matrix.fixed_view::<6, 6>(POSE, POSE).into_owned()
    }

    /// Replaces the covariances of both lenses (16 × 16) and removes their correlation with each other and with the pose.
    #[must_use]
    pub fn with_lenses(self, lenses: [&SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>; 2]) -> Self {
        let mut matrix = self.matrix;
        for (lens, first) in lenses.into_iter().zip([0, LENS_PARAMETERS]) {
            matrix.fixed_columns_mut::<LENS_PARAMETERS>(first).fill(0.0);
            matrix.fixed_rows_mut::<LENS_PARAMETERS>(first).fill(0.0);
            matrix.fixed_view_mut::<LENS_PARAMETERS, LENS_PARAMETERS>(first, first).copy_from(lens);
        }
        Self::joint(matrix)
    }

    /// The covariance of numbers (rows) with others (columns), by the derivatives of both. Exact parameters cost little.
    pub(crate) fn between<const N: usize>(
        &self,
        by_shared: &SMatrix<f64, N, SHARED_PARAMETERS>,
        other: &SMatrix<f64, N, SHARED_PARAMETERS>,
    ) -> SMatrix<f64, N, N> {
        let (unknown, count) = &self.unknown;
        let unknown = &unknown[..*count];
        let mut with_shared = SMatrix::<f64, SHARED_PARAMETERS, N>::zeros();
        for (row, mut with_shared) in by_shared.row_iter().zip(with_shared.column_iter_mut()) {
            with_shared.copy_from_slice(&combined(&std::array::from_fn(|i| row[i]), unknown, &self.rows));
        }
        let mut sum = SMatrix::zeros();
        for &column in unknown {
            sum += with_shared.row(column).transpose() * other.column(column).transpose();
        }
        sum
    }

    /// The covariance matrix, in the order stated at the type.
    #[must_use]
    pub const fn matrix(&self) -> &Covariance {
        &self.matrix
    }
}

/// The sum of `rows` by their `factors`, each number in the order of the `chosen` ones.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn combined(factors: &OfEach<f64>, chosen: &[usize], rows: &OfEach<OfEach<f64>>) -> OfEach<f64> {
    let mut sums = [0.0; SHARED_PARAMETERS];
    for &row in chosen {
        for (sum, number) in sums.iter_mut().zip(&rows[row]) {
            *sum += factors[row] * number;
        }
    }
    sums
}
