//! What each fuzz target does with its bytes. Run one by hand, with cargo-fuzz installed:
//!
//! ```text
//! RUSTC_BOOTSTRAP=1 cargo fuzz run --fuzz-dir tests/fuzz board_node -- -max_total_time=600
//! ```
//!
//! The same bodies run on stable with seeded random bytes: `cargo test -p vergence-control --test fuzz_smoke`.

mod bodies;

pub use bodies::*;
