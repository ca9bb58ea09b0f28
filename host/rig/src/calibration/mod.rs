//! What a calibration leaves uncertain of a rig, and the covariance that all points of a pair share by it.

mod lenses;
mod number;
mod own_frame;
mod table;

use nalgebra::{DMatrix, Matrix6xX, SMatrix};
use vergence_vision::{Angle, LENS_PARAMETERS, Length, SHARED_PARAMETERS, SharedCovariance, Side};

pub use self::lenses::UnknownLensErrors;
pub use self::number::RigNumber;
pub use self::own_frame::{common_turn_by_lens, even_directions};
pub(crate) use self::table::{CalibrationTables, SigmaFile};
use crate::repeatability::of_components;
use crate::rig::Rig;

/// How far the numbers of a rig may be off.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum RigCalibration {
    /// The file does not say.
    #[default]
    Unknown,
    /// Standard deviations of each component of the relative pose, the same wherever the axes stand. The lenses count as exact.
    Sigmas {
        /// Of the rotation about each axis.
        rotation: Angle,
        /// Of the position along each axis.
        translation: Length,
    },
    /// The covariance of the rig's numbers.
    Covariance(CalibratedNumbers),
}

/// Numbers of a rig that a calibration determined, and their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedNumbers {
    numbers: Vec<RigNumber>,
    covariance: DMatrix<f64>,
}

/// The reason why a covariance is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidCovariance {
    /// It has not one row and one column for each number.
    #[error("it must have a row for each of the {0} numbers, with 1, 2, 3 and more values: its lower triangle")]
    Shape(usize),
    /// One number is named twice.
    #[error("'{0}' is named twice")]
    Twice(String),
    /// A value is not finite, or the matrix has a negative direction.
    #[error("it is no covariance: it is not finite, or not positive semidefinite")]
    Indefinite,
}

impl CalibratedNumbers {
    /// The `covariance` of `numbers`, in their order and units.
    ///
    /// # Errors
    /// [`InvalidCovariance`] where it is none.
    pub fn new(numbers: Vec<RigNumber>, covariance: DMatrix<f64>) -> Result<Self, InvalidCovariance> {
        if covariance.shape() != (numbers.len(), numbers.len()) {
            return Err(InvalidCovariance::Shape(numbers.len()));
        }
        if let Some(twice) = numbers.iter().enumerate().find(|(index, number)| numbers[..*index].contains(number)) {
            return Err(InvalidCovariance::Twice(format!("{:?}", twice.1)));
        }
        if !is_semidefinite(&covariance) {
            return Err(InvalidCovariance::Indefinite);
        }
        Ok(Self { numbers, covariance })
    }

    /// The numbers, in the order of the covariance.
    #[must_use]
    pub fn numbers(&self) -> &[RigNumber] {
        &self.numbers
    }

    /// Their covariance; units as [`RigNumber`] states them.
    #[must_use]
    pub const fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// The same for images `factor` times as wide.
    pub(crate) fn resampled(mut self, factor: [f64; 2]) -> Self {
        for (index, number) in self.numbers.iter().enumerate() {
            if let RigNumber::Lens { side, parameter: 0..4 } = number {
                let factor = factor[usize::from(*side == Side::Right)];
                self.covariance.row_mut(index).scale_mut(factor);
                self.covariance.column_mut(index).scale_mut(factor);
            }
        }
        self
    }
}

/// Whether a symmetric matrix is a covariance, up to rounding. Radians and millimetres differ by orders of magnitude, so it is
/// scaled to a unit diagonal first.
fn is_semidefinite(matrix: &DMatrix<f64>) -> bool {
    const ROUNDING: f64 = 1e-9;
    let diagonal = matrix.diagonal();
    if !matrix.iter().all(|value| value.is_finite()) || diagonal.iter().any(|&variance| variance < 0.0) {
        return false;
    }
    let scale = diagonal.map(|variance| if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        matrix[(row, column)] * scale[row] * scale[column]
    });
    let of_none = |row: usize, column: usize| scale[row] * scale[column] == 0.0 && matrix[(row, column)] != 0.0;
    if (0..matrix.nrows()).any(|row| (0..matrix.ncols()).any(|column| of_none(row, column))) {
        return false;
    }
    scaled.is_empty() || scaled.symmetric_eigenvalues().min() > -ROUNDING * matrix.nrows() as f64
}

impl RigCalibration {
    /// Lenses and relative pose are known exactly.
    #[must_use]
    pub const fn exact() -> Self {
        Self::Sigmas { rotation: Angle::from_rad(0.0), translation: Length::from_mm(0.0) }
    }

    /// Whether anything is known of it.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        !matches!(self, Self::Unknown)
    }
}

impl Rig {
    /// The covariance of lenses and relative pose that the calibration leaves with the axes of the left camera at `left` and those of
    /// the right one at `right`, in millimetres and radians. That of a trunk's numbers is no part of it.
    #[must_use]
    pub(crate) fn calibration_covariance(&self, left: &[f64], right: &[f64]) -> SharedCovariance {
        match &self.calibration {
            RigCalibration::Unknown => SharedCovariance::exact(),
            RigCalibration::Sigmas { rotation, translation } => {
                SharedCovariance::exact().with_pose(&of_components(*rotation, *translation))
            }
            RigCalibration::Covariance(found) => {
                let by_numbers = self.shared_by_numbers(found.numbers(), left, right);
                let total = &by_numbers * found.covariance() * by_numbers.transpose();
                SharedCovariance::joint(SMatrix::from_fn(|row, column| total[(row, column)]))
            }
        }
    }

    /// Derivative of the shared parameters (rows, in the order of [`SharedCovariance`]) by `numbers` (columns), in the frames of both cameras'
    /// rays ([`own_frame`]).
    fn shared_by_numbers(&self, numbers: &[RigNumber], left: &[f64], right: &[f64]) -> DMatrix<f64> {
        const POSE: usize = 2 * LENS_PARAMETERS;
        let mut derivative = DMatrix::zeros(SHARED_PARAMETERS, numbers.len());
        let pose: Matrix6xX<f64> = self.pose_by_numbers(numbers, left, right);
        derivative.rows_mut(POSE, 6).copy_from(&pose);
        for (column, number) in numbers.iter().enumerate() {
            if let Some(row) = number.shared_row() {
                derivative[(row, column)] = 1.0;
            }
        }
        let (_, left_from_right) = self.transforms(left, right);
        own_frame::in_own_frames(&mut derivative, numbers, [&self.left_camera, &self.right_camera], &left_from_right);
        derivative
    }
}
