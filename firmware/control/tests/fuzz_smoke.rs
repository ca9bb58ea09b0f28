//! The fuzz targets on stable: seeded random bytes, few in every run, ten million by hand:
//!
//! ```text
//! FUZZ_INPUTS=10000000 cargo test --release -p vergence-control --test fuzz_smoke -- --nocapture
//! ```
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

#[path = "../../../tests/fuzz/src/bodies.rs"]
mod bodies;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// In every run, over all targets.
const INPUTS: usize = 200_000;

/// Bytes with many small ones, zeros and ones among them: messages are made of those.
fn input(random: &mut Pcg64Mcg, bytes: &mut Vec<u8>) {
    bytes.clear();
    let longest = 1_usize << random.random_range(1..10);
    let length = random.random_range(0..longest);
    let small = random.random_range(0.0..1.0);
    bytes.extend(
        (0..length).map(|_| if random.random_bool(small) { random.random_range(0..24) } else { random.random() }),
    );
}

/// Runs a share of the inputs through a target.
fn smoke(share: f64, seed: u64, target: fn(&[u8])) {
    let inputs = std::env::var("FUZZ_INPUTS").ok().and_then(|number| number.parse().ok()).unwrap_or(INPUTS);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut bytes = Vec::new();
    for number in 0..(inputs as f64 * share) as usize {
        input(&mut random, &mut bytes);
        if std::panic::catch_unwind(|| target(&bytes)).is_err() {
            panic!("input {number}: {bytes:?}");
        }
    }
}

#[test]
fn frame() {
    smoke(0.3, 1, bodies::frame);
}

#[test]
fn host_session() {
    smoke(0.2, 2, bodies::host_session);
}

#[test]
fn board_node() {
    smoke(0.3, 3, bodies::board_node);
}

#[test]
fn settings_store() {
    smoke(0.1, 4, bodies::settings_store);
}

#[test]
fn management() {
    smoke(0.1, 5, bodies::management);
}
