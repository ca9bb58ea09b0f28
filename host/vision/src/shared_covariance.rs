//! The covariance of what all points of a pair share: lenses and pose.

use multiversion::multiversion;
use nalgebra::{Matrix6, SMatrix};

use crate::lens_derivatives::LENS_PARAMETERS;

/// Number of parameters that all points of a pair share: those of both lenses and the six of the pose.
pub const SHARED_PARAMETERS: usize = 2 * LENS_PARAMETERS + 6;
/// The first parameter of the pose.
const POSE: usize = 2 * LENS_PARAMETERS;
/// Parameters that are not exact of a pair whose lenses have five terms of the radius and one of the pupil each, or fewer.
const FEW: usize = 24;

/// The covariance of all shared parameters.
type Covariance = SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>;
/// A number for each shared parameter.
type OfEach<T> = [T; SHARED_PARAMETERS];

/// The covariance (42 × 42) of the parameters that all points of a pair share.
///
/// Their order is: left lens, right lens (each in the order of [`LENS_PARAMETERS`]), then the relative pose as a turn ω about the left axes
/// in radians and a shift δ of the right camera in the left frame in millimetres: R ← exp(ω) R, t ← t + δ. Rows and columns of parameters
/// that are exact, such as those that a lens does not have, are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedCovariance {
    matrix: Covariance,
    /// Its rows and columns of the parameters that are not exact, row by row.
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
        let mut rows = [[0.0; SHARED_PARAMETERS]; SHARED_PARAMETERS];
        for (row, place) in (0..count).flat_map(|row| (0..count).map(move |place| (row, place))) {
            rows[row][place] = covariance[(unknown[row], unknown[place])];
        }
        Self { matrix: covariance, rows, unknown: (unknown, count) }
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

    /// Replaces the covariances of both lenses (18 × 18) and removes their correlation with each other and with the pose.
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
        let unknown = &self.unknown.0[..self.unknown.1];
        let mut with_unknown = SMatrix::<f64, SHARED_PARAMETERS, N>::zeros();
        for (row, mut with_unknown) in by_shared.row_iter().zip(with_unknown.column_iter_mut()) {
            with_unknown.copy_from_slice(&combined(&std::array::from_fn(|i| row[i]), unknown, &self.rows));
        }
        let mut sum = SMatrix::zeros();
        for (place, &column) in unknown.iter().enumerate() {
            sum += with_unknown.row(place).transpose() * other.column(column).transpose();
        }
        sum
    }

    /// The covariance matrix, in the order stated at the type.
    #[must_use]
    pub const fn matrix(&self) -> &Covariance {
        &self.matrix
    }
}

/// The sum of the `rows` of the `unknown` parameters by their `factors`.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn combined(factors: &OfEach<f64>, unknown: &[usize], rows: &OfEach<OfEach<f64>>) -> OfEach<f64> {
    let mut sums = [0.0; SHARED_PARAMETERS];
    let factors = unknown.iter().map(|&parameter| factors[parameter]).zip(rows);
    match unknown.len() {
        ..=FEW => add::<FEW>(factors, &mut sums),
        _ => add::<SHARED_PARAMETERS>(factors, &mut sums),
    }
    sums
}

/// Adds the first so many numbers of rows by their factors.
#[inline(always)]
fn add<'a, const MOST: usize>(rows: impl Iterator<Item = (f64, &'a OfEach<f64>)>, sums: &mut OfEach<f64>) {
    for (factor, row) in rows {
        for (sum, number) in sums[..MOST].iter_mut().zip(&row[..MOST]) {
            *sum += factor * number;
        }
    }
}
