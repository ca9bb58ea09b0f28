//! Batch kernels: many points at once, on one thread, in plain arrays.
//!
//! The kernels are branch-free functions on arrays of lanes, or of one row in long loops, which the compiler turns into vector instructions: the
//! best ones found at run time (AVX-512, or AVX2 and FMA), or those that every processor of the target has. The two
//! differ in the last bits, so results that must repeat to the bit on any machine come from the single-point functions.
//!
//! Arrays hold one point, ray or pixel per row: N × 3 or N × 2. An input without a result (outside the field, behind a
//! camera, not a number) gives a row of NaN, so that rows keep their index.

mod arc_tangent;
mod chebyshev;
mod derivatives;
mod displaced;
mod fold;
mod foreign;
mod lanes;
mod lens;
mod pair;
mod pairs;
mod plane;
mod project;
mod pupil;
mod radial;
mod shared_errors;
mod slope;
mod splined;
mod splined_back;
mod stepwise;
mod stepwise_back;
mod surface;
mod triangulate;
mod unproject;
mod vectors;

pub use derivatives::ProjectedPoints;
pub use lens::BatchLens;
pub use pair::{BatchPair, BatchPoints};
pub use triangulate::{BatchTriangulation, triangulate_batch};

/// Processor instructions that the batch kernels may use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The best instructions that this machine has and the kernels support.
    #[default]
    Best,
    /// The instructions that every machine of the compile target has, for comparison.
    Baseline,
}

impl Instructions {
    /// Short name of the instructions behind [`Instructions::Best`] on this machine, such as `avx2+fma`.
    #[must_use]
    pub fn best_name() -> &'static str {
        lanes::best_name()
    }
}
