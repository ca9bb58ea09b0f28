//! The clock map over links of every kind in virtual time. The laws and exact cases are in `laws`.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod laws;
mod link;

use link::{Delay, Link, Outcome};
use vergence_rig::ClockMap;

const SEEDS: u64 = 50;
const SECONDS: f64 = 180.0;
/// Instant from which the bounds are judged; the coverage counts from the first exchange.
const SETTLED_US: f64 = 10e6;
const BAUD: u32 = 921_600;

/// The figures of a link over all seeds, in microseconds.
#[derive(Debug)]
#[allow(dead_code, reason = "printed where a test fails")]
struct Figures {
    coverage: f64,
    coverage_of_worst_seed: f64,
    median_error: f64,
    median_bound: f64,
    largest_bound: f64,
}

fn figures(link: Link, map: &ClockMap) -> Figures {
    let runs: Vec<Vec<Outcome>> = (0..SEEDS).map(|seed| link.run(seed, map.clone(), SECONDS)).collect();
    let all = runs.concat();
    for outcome in &all {
        // The instant on the board's clock is rounded to a whole microsecond in between.
        assert!(outcome.round_trip_us <= 0.51 && outcome.round_trip_us <= outcome.round_trip_bound_us, "{outcome:?}");
    }
    let settled: Vec<Outcome> = all.iter().copied().filter(|outcome| outcome.at_us >= SETTLED_US).collect();
    Figures {
        coverage: coverage(&all),
        coverage_of_worst_seed: runs.iter().map(|run| coverage(run)).fold(1.0, f64::min),
        median_error: median(settled.iter().map(|outcome| outcome.error_us)),
        median_bound: median(settled.iter().map(|outcome| outcome.bound_us)),
        largest_bound: settled.iter().map(|outcome| outcome.bound_us).fold(0.0, f64::max),
    }
}

fn coverage(outcomes: &[Outcome]) -> f64 {
    let covered = outcomes.iter().filter(|outcome| outcome.error_us <= outcome.bound_us).count();
    covered as f64 / outcomes.len() as f64
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A wire whose timestamps are early or late by 20 us at either end.
const CLEAN: Link =
    Link { baud: Some(BAUD), down: Delay::Uniform(-20.0, 20.0), up: Delay::Uniform(-20.0, 20.0), loss: 0.0 };
/// A wire without early timestamps.
const LATE: Link = Link { down: Delay::Uniform(0.0, 40.0), up: Delay::Uniform(0.0, 40.0), ..CLEAN };
const BRIDGE: Link = Link { up: Delay::Uniform(1e3, 16e3), ..LATE };

#[test]
fn a_clean_link_is_known_to_60_us() {
    let got = figures(CLEAN, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && got.coverage_of_worst_seed >= 0.95, "{got:?}");
    assert!(got.largest_bound < 60.0 && got.median_bound < 20.0 && got.median_error < 5.0, "{got:?}");
    let got = figures(LATE, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && got.median_bound < 45.0 && got.median_error < 5.0, "{got:?}");
}

#[test]
fn without_the_baud_rate_half_of_the_wire_is_unknown() {
    let got = figures(CLEAN, &ClockMap::default());
    assert!(got.coverage >= 0.95 && got.median_bound < 250.0 && got.median_error < 70.0, "{got:?}");
}

/// Half a millisecond cannot be told from a shorter way down: the shortest leg up takes a whole one.
#[test]
fn a_usb_bridge_is_known_to_a_millisecond() {
    let got = figures(BRIDGE, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && got.coverage_of_worst_seed >= 0.95, "{got:?}");
    assert!((500.0..1_000.0).contains(&got.median_bound), "{got:?}");
    let got = figures(Link { up: Delay::LatencyTimer, ..LATE }, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && (500.0..1_200.0).contains(&got.median_bound), "{got:?}");
}

#[test]
fn lost_exchanges_cost_little() {
    let got = figures(Link { loss: 0.05, ..CLEAN }, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && got.largest_bound < 60.0 && got.median_bound < 20.0, "{got:?}");
    let got = figures(Link { loss: 0.05, ..BRIDGE }, &ClockMap::at_baud(BAUD));
    assert!(got.coverage >= 0.95 && got.median_bound < 1_000.0, "{got:?}");
}

#[test]
fn bursts_in_one_direction_cost_little() {
    for link in [Link { up: Delay::Bursts(30e3), ..LATE }, Link { down: Delay::Bursts(30e3), ..LATE }] {
        let got = figures(link, &ClockMap::at_baud(BAUD));
        assert!(got.coverage >= 0.95 && got.coverage_of_worst_seed >= 0.95, "{got:?}");
        assert!(got.median_bound < 45.0 && got.median_error < 6.0 && got.largest_bound < 150.0, "{got:?}");
    }
}

/// A USB port takes any baud rate and is bound by none; the wire time subtracted would be 2 ms of error.
#[test]
fn a_meaningless_baud_rate_is_dropped() {
    let got = figures(Link { baud: None, ..LATE }, &ClockMap::at_baud(115_200));
    assert!(got.coverage >= 0.95 && got.coverage_of_worst_seed >= 0.95 && got.median_bound < 20.0, "{got:?}");
}
