//! Poses as other programs write them, in metres.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use vergence_vision::{Frame, Transform};

use crate::ExchangeError;
use crate::node::Node;

/// Millimetres in a metre.
pub const METRE: f64 = 1000.0;

/// A transform from the rows of a 3 x 4 or 4 x 4 matrix whose translation is in metres.
pub fn of_matrix<To: Frame, From: Frame>(node: &Node) -> Result<Transform<To, From>, ExchangeError> {
    let numbers = node.numbers()?;
    let rows = match numbers.len() {
        12 => &numbers[..],
        16 if numbers[12..15].iter().all(|zero| *zero == 0.0) && numbers[15] == 1.0 => &numbers[..12],
        16 => return Err(node.wrong("is no rigid transform: its last row must be 0 0 0 1")),
        other => return Err(node.wrong(format!("has {other} numbers, not the 16 of a transform"))),
    };
    let rotation = Matrix3::from_fn(|row, column| rows[4 * row + column]);
    let metres = Vector3::from_fn(|row, _| rows[4 * row + 3]);
    Ok(Transform::new(self::rotation(node, rotation)?, metres * METRE))
}

/// A rotation from a matrix that is one, up to the digits of a file.
pub fn rotation(node: &Node, matrix: Matrix3<f64>) -> Result<UnitQuaternion<f64>, ExchangeError> {
    let off = (matrix * matrix.transpose() - Matrix3::identity()).norm();
    if off.is_nan() || off > 1e-3 || matrix.determinant() < 0.0 {
        return Err(node.wrong("is no rigid transform: its rotation is none"));
    }
    // The nearest rotation, because files have few digits.
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(&matrix, 1e-14, 100, Rotation3::identity())))
}

/// A rotation from a quaternion of unit length.
pub fn quaternion(node: &Node, [w, x, y, z]: [f64; 4]) -> Result<UnitQuaternion<f64>, ExchangeError> {
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        return Err(node.wrong("is no rotation: its quaternion has not the length 1"));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}
