//! Arithmetic on vectors of three components, one vector in each lane.

use nalgebra::Matrix3;

use super::lanes::multiply_add;

/// The components x, y and z, each for all lanes.
pub(super) type Vectors<const W: usize> = [[f64; W]; 3];

#[inline(always)]
pub(super) fn dot<const FUSED: bool, const W: usize>(a: &Vectors<W>, b: &Vectors<W>) -> [f64; W] {
    let mut out = [0.0; W];
    for j in 0..W {
        let yz = multiply_add::<FUSED>(a[1][j], b[1][j], a[2][j] * b[2][j]);
        out[j] = multiply_add::<FUSED>(a[0][j], b[0][j], yz);
    }
    out
}

#[inline(always)]
pub(super) fn cross<const FUSED: bool, const W: usize>(a: &Vectors<W>, b: &Vectors<W>) -> Vectors<W> {
    let mut out = [[0.0; W]; 3];
    for j in 0..W {
        let minor = |i: usize, k: usize| multiply_add::<FUSED>(a[i][j], b[k][j], -(a[k][j] * b[i][j]));
        (out[0][j], out[1][j], out[2][j]) = (minor(1, 2), minor(2, 0), minor(0, 1));
    }
    out
}

#[inline(always)]
pub(super) fn scaled<const W: usize>(factor: &[f64; W], vector: &Vectors<W>) -> Vectors<W> {
    let mut out = *vector;
    for component in &mut out {
        for j in 0..W {
            component[j] *= factor[j];
        }
    }
    out
}

#[inline(always)]
pub(super) fn turned<const FUSED: bool, const W: usize>(turn: &Matrix3<f64>, vector: &Vectors<W>) -> Vectors<W> {
    let mut out = [[0.0; W]; 3];
    for (row, out) in out.iter_mut().enumerate() {
        *out = dot::<FUSED, W>(&[[turn[(row, 0)]; W], [turn[(row, 1)]; W], [turn[(row, 2)]; W]], vector);
    }
    out
}
