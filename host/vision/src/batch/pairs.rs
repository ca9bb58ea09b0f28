//! The loop over pairs of rays that runs a kernel block by block.

use super::lanes::padded;

/// A branch-free function of pairs of rays, computed for `W` pairs at once: points, and `REST` numbers of their covariances.
pub(super) trait Rows<const W: usize, const REST: usize> {
    fn rows<const FUSED: bool>(&self, left: &[[f64; 3]; W], right: &[[f64; 3]; W])
    -> ([[f64; 3]; W], [[f64; REST]; W]);
}

/// Runs `kernel` on every pair of rays, and appends its results to `points` and `covariances`. Both slices of rays have the same length.
#[inline(always)]
pub(super) fn for_pairs<const FUSED: bool, const W: usize, const REST: usize>(
    kernel: &impl Rows<W, REST>,
    [left, right]: [&[[f64; 3]]; 2],
    points: &mut Vec<[f64; 3]>,
    covariances: &mut Vec<[f64; REST]>,
) {
    points.reserve(left.len());
    covariances.reserve(left.len());
    let ((left_blocks, left_rest), (right_blocks, right_rest)) = (left.as_chunks(), right.as_chunks());
    for (left, right) in left_blocks.iter().zip(right_blocks) {
        let (new_points, new_covariances) = kernel.rows::<FUSED>(left, right);
        points.extend_from_slice(&new_points);
        covariances.extend_from_slice(&new_covariances);
    }
    let count = left_rest.len();
    if count > 0 {
        let (new_points, new_covariances) = kernel.rows::<FUSED>(&padded(left_rest), &padded(right_rest));
        points.extend_from_slice(&new_points[..count]);
        covariances.extend_from_slice(&new_covariances[..count]);
    }
}
