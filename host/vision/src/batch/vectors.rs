//! Arithmetic on vectors of three components, fused on machines that have it.

use nalgebra::{Matrix3, Vector3};

use super::lanes::multiply_add;

#[inline(always)]
pub(super) fn dot<const FUSED: bool>(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    multiply_add::<FUSED>(a.x, b.x, multiply_add::<FUSED>(a.y, b.y, a.z * b.z))
}

#[inline(always)]
pub(super) fn cross<const FUSED: bool>(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    let minor = |i: usize, j: usize| multiply_add::<FUSED>(a[i], b[j], -(a[j] * b[i]));
    Vector3::new(minor(1, 2), minor(2, 0), minor(0, 1))
}

/// Returns α a + β b.
#[inline(always)]
pub(super) fn sum<const FUSED: bool>(alpha: f64, a: &Vector3<f64>, beta: f64, b: &Vector3<f64>) -> Vector3<f64> {
    let component = |i: usize| multiply_add::<FUSED>(alpha, a[i], beta * b[i]);
    Vector3::new(component(0), component(1), component(2))
}

#[inline(always)]
pub(super) fn turned<const FUSED: bool>(turn: &Matrix3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    let component = |row: usize| {
        let yz = multiply_add::<FUSED>(turn[(row, 1)], vector.y, turn[(row, 2)] * vector.z);
        multiply_add::<FUSED>(turn[(row, 0)], vector.x, yz)
    };
    Vector3::new(component(0), component(1), component(2))
}
