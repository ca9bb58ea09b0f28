//! The stages of all scenarios: those of the bench.

use vergence_plant::{Stage, bench_mechanics, bench_settings};

/// Baseline and separation of the bench.
#[must_use]
pub fn stages() -> [Stage; 2] {
    let [first, second] = bench_settings();
    let [baseline, separation] = bench_mechanics();
    [Stage { settings: first, mechanics: baseline }, Stage { settings: second, mechanics: separation }]
}
