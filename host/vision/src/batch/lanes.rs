//! Conversion between rows and lanes, and fused arithmetic on machines that have it.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

/// Whether every processor of the compile target has fused multiply-add. Without it `mul_add` calls a slow library
/// function.
pub(super) const ALWAYS_FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

/// A branch-free function of `IN` numbers with `OUT` results, computed for `W` rows at once.
pub(super) trait Kernel<const IN: usize, const OUT: usize> {
    fn lanes<const FUSED: bool, const W: usize>(&self, columns: [[f64; W]; IN]) -> [[f64; W]; OUT];
}

/// Returns a b + c.
#[inline(always)]
pub(super) fn multiply_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Evaluates the polynomial with ascending `coefficients` at each of `t`.
#[inline(always)]
pub(super) fn polynomial<const FUSED: bool, const W: usize>(coefficients: &[f64], t: &[f64; W]) -> [f64; W] {
    let mut sum = [0.0; W];
    for &coefficient in coefficients.iter().rev() {
        for j in 0..W {
            sum[j] = multiply_add::<FUSED>(sum[j], t[j], coefficient);
        }
    }
    sum
}

/// The same for one number.
#[inline(always)]
pub(super) fn polynomial_at<const FUSED: bool>(coefficients: &[f64], t: f64) -> f64 {
    let [sum] = polynomial::<FUSED, 1>(coefficients, &[t]);
    sum
}

/// Appends the kernel's results for all `rows` to `out`, `W` rows at a time, so that reading, computing and writing
/// overlap.
#[inline(always)]
pub(super) fn for_rows<const FUSED: bool, const W: usize, const IN: usize, const OUT: usize>(
    kernel: &impl Kernel<IN, OUT>,
    rows: &[[f64; IN]],
    out: &mut Vec<[f64; OUT]>,
) {
    out.reserve(rows.len());
    let (blocks, rest) = rows.as_chunks::<W>();
    for block in blocks {
        out.extend_from_slice(&rows_of(&kernel.lanes::<FUSED, W>(columns_of(block))));
    }
    if !rest.is_empty() {
        let results = rows_of(&kernel.lanes::<FUSED, W>(columns_of(&padded::<W, IN>(rest))));
        out.extend_from_slice(&results[..rest.len()]);
    }
}

/// Two functions which append a kernel's results for rows: by the instructions that every processor has, and by the best of this one.
macro_rules! over_rows {
    ($baseline:ident, $best:ident, $kernel:ty, $lanes:ident, $in:literal => $out:literal) => {
        pub(super) fn $baseline(kernel: &$kernel, rows: &[[f64; $in]], out: &mut Vec<[f64; $out]>) {
            $crate::batch::lanes::for_rows::<{ $crate::batch::lanes::ALWAYS_FUSED }, $lanes, $in, $out>(
                kernel, rows, out,
            );
        }

        #[multiversion::multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
        pub(super) fn $best(kernel: &$kernel, rows: &[[f64; $in]], out: &mut Vec<[f64; $out]>) {
            use $crate::batch::lanes::{ALWAYS_FUSED, for_rows};
            if multiversion::target::target_cfg_f!(target_feature = "fma") {
                for_rows::<true, $lanes, $in, $out>(kernel, rows, out);
            } else {
                for_rows::<ALWAYS_FUSED, $lanes, $in, $out>(kernel, rows, out);
            }
        }
    };
}
pub(super) use over_rows;

/// Fills fewer than `W` rows up with rows of zeros.
#[inline(always)]
pub(super) fn padded<const W: usize, const C: usize>(rest: &[[f64; C]]) -> [[f64; C]; W] {
    let mut padded = [[0.0; C]; W];
    padded[..rest.len()].copy_from_slice(rest);
    padded
}

#[inline(always)]
pub(super) fn columns_of<const W: usize, const C: usize>(rows: &[[f64; C]; W]) -> [[f64; W]; C] {
    let mut columns = [[0.0; W]; C];
    for (i, row) in rows.iter().enumerate() {
        for (column, value) in columns.iter_mut().zip(row) {
            column[i] = *value;
        }
    }
    columns
}

#[inline(always)]
pub(super) fn rows_of<const W: usize, const C: usize>(columns: &[[f64; W]; C]) -> [[f64; C]; W] {
    let mut rows = [[0.0; C]; W];
    for (i, row) in rows.iter_mut().enumerate() {
        for (value, column) in row.iter_mut().zip(columns) {
            *value = column[i];
        }
    }
    rows
}

/// Short name of the instructions that the kernels use on this machine.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
pub(super) fn best_name() -> &'static str {
    match (target_cfg_f!(target_feature = "avx512f"), target_cfg_f!(target_feature = "avx2")) {
        (true, _) => "avx512",
        (_, true) => "avx2+fma",
        _ => std::env::consts::ARCH,
    }
}
