//! Many points at once, on one thread, in plain arrays.
//!
//! The kernels are branch-free functions on arrays of lanes that the compiler turns into vector instructions: those of
//! the machine at hand (AVX-512, or AVX2 and FMA, found at run time), or those every processor of its kind has. The two differ in
//! the last bits, so results that must repeat to the bit on any machine come from the single-point functions.
//!
//! Arrays hold one point, ray or pixel per row: N × 3 or N × 2. What has no result (outside the field, behind a camera,
//! not a number) is a row of NaN, so that rows keep their place.

mod arc_tangent;
mod chebyshev;
mod lanes;
mod lens;
mod pair;
mod pairs;
mod project;
mod slope;
mod triangulate;
mod unproject;
mod vectors;

pub use lens::BatchLens;
pub use pair::{BatchPair, BatchPoints};
pub use triangulate::{BatchTriangulation, triangulate_batch};

/// Which instructions the kernels may use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The best that the machine has and the kernels know.
    #[default]
    Best,
    /// Those that every machine of this kind has, to compare with.
    Baseline,
}

impl Instructions {
    /// A short name of what [`Instructions::Best`] is on this machine.
    #[must_use]
    pub fn best_name() -> &'static str {
        lanes::best_name()
    }
}
