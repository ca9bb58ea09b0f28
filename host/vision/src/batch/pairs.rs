//! The loop over pairs of rays that runs a kernel block by block.

use super::lanes::{Kernel, columns_of, padded, rows_of};

/// Rows per step with AVX-512: one vector. The kernels hold some thirty values per row, for which the sixteen registers of other
/// processors are too few: two vectors of four lanes at a time take half as long again.
pub(super) const WIDE: usize = 8;
/// Rows per step with other instructions.
pub(super) const NARROW: usize = 4;

/// Runs `kernel` on every pair of rays. The first three of its `OUT` columns are appended to `points`, the other `REST`
/// to `covariances`. Both slices of rays have the same length.
#[inline(always)]
pub(super) fn for_pairs<const FUSED: bool, const W: usize, const OUT: usize, const REST: usize>(
    kernel: &impl Kernel<6, OUT>,
    [left, right]: [&[[f64; 3]]; 2],
    points: &mut Vec<[f64; 3]>,
    covariances: &mut Vec<[f64; REST]>,
) {
    const { assert!(OUT == 3 + REST, "a point and its covariance") };
    points.reserve(left.len());
    covariances.reserve(left.len());
    let ((left_blocks, left_rest), (right_blocks, right_rest)) = (left.as_chunks(), right.as_chunks());
    for (left, right) in left_blocks.iter().zip(right_blocks) {
        let (new_points, new_covariances) = block::<FUSED, W, OUT, REST>(kernel, left, right);
        points.extend_from_slice(&new_points);
        covariances.extend_from_slice(&new_covariances);
    }
    let count = left_rest.len();
    if count > 0 {
        let (left, right) = (padded(left_rest), padded(right_rest));
        let (new_points, new_covariances) = block::<FUSED, W, OUT, REST>(kernel, &left, &right);
        points.extend_from_slice(&new_points[..count]);
        covariances.extend_from_slice(&new_covariances[..count]);
    }
}

#[inline(always)]
fn block<const FUSED: bool, const W: usize, const OUT: usize, const REST: usize>(
    kernel: &impl Kernel<6, OUT>,
    left: &[[f64; 3]; W],
    right: &[[f64; 3]; W],
) -> ([[f64; 3]; W], [[f64; REST]; W]) {
    let ([ux, uy, uz], [vx, vy, vz]) = (columns_of(left), columns_of(right));
    let made = kernel.lanes::<FUSED, W>([ux, uy, uz, vx, vy, vz]);
    let mut covariances = [[0.0; W]; REST];
    covariances.copy_from_slice(&made[3..]);
    (rows_of(&[made[0], made[1], made[2]]), rows_of(&covariances))
}
