//! Rigid transform between two sets of corresponding points, by least squares.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use vergence_vision::{Frame, Point, Transform};

/// Least separation of the singular values of the cross-covariance, as a share of the largest.
const SEPARATION: f64 = 1e-9;

/// Why two sets of points do not determine a transform.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ArunError {
    /// Fewer than three pairs.
    #[error("{0} pairs of points; a rotation and translation need at least 3")]
    TooFewPoints(usize),
    /// A coordinate is infinite or not a number.
    #[error("a coordinate is not a finite number")]
    NotFinite,
    /// All points lie on one line, or the sets differ so much that several rotations fit equally.
    #[error("the points leave the rotation open: they lie on one line, or the clouds are mirror images")]
    Degenerate,
}

/// The transform that maps the second point of each pair closest to the first, in the least-squares sense.
///
/// K. Arun, T. Huang and S. Blostein, "Least-squares fitting of two 3-D point sets", PAMI 9(5), 1987; never a
/// reflection, by S. Umeyama, "Least-squares estimation of transformation parameters", PAMI 13(4), 1991, eq. 43.
///
/// # Errors
/// [`ArunError`] for fewer than three pairs, points on a line, and coordinates that are not finite.
pub fn fit_rotation_translation<To: Frame, From: Frame>(
    pairs: &[(Point<To>, Point<From>)],
) -> Result<Transform<To, From>, ArunError> {
    if pairs.len() < 3 {
        return Err(ArunError::TooFewPoints(pairs.len()));
    }
    let count = pairs.len() as f64;
    let to_centre = pairs.iter().map(|(to, _)| to.mm()).sum::<Vector3<f64>>() / count;
    let from_centre = pairs.iter().map(|(_, from)| from.mm()).sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> =
        pairs.iter().map(|(to, from)| (to.mm() - to_centre) * (from.mm() - from_centre).transpose()).sum();
    if !covariance.iter().all(|x| x.is_finite()) {
        return Err(ArunError::NotFinite);
    }
    let rotation = nearest_rotation(&covariance).ok_or(ArunError::Degenerate)?;
    Ok(Transform::new(rotation, to_centre - rotation * from_centre))
}

/// The rotation R that maximises tr(RᵀM); for a nearly orthogonal M the nearest rotation. `None` where it is not unique:
/// it is unique if and only if σ₂ + det(UVᵀ) σ₃ > 0.
pub(crate) fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let svd = matrix.try_svd(true, true, f64::EPSILON, 0)?;
    let (mut u, v_transposed) = (svd.u?, svd.v_t?);
    let sign = (u * v_transposed).determinant().signum();
    let [largest, middle, smallest] = svd.singular_values.into();
    if middle + sign * smallest <= SEPARATION * largest || largest <= 0.0 {
        return None;
    }
    u.column_mut(2).scale_mut(sign);
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_transposed)))
}
