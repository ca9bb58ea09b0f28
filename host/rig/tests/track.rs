//! The encoder stream.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_protocol::{AxisList, Counts, Microseconds};
use vergence_rig::{BoardInstant, JointSample, JointTrack, TrackGap};

fn sample(at: u64, counts: &[i32]) -> JointSample {
    JointSample { at: Microseconds(at), counts: counts.iter().map(|&c| Counts(c)).collect::<AxisList<_>>() }
}

fn instant(us: f64) -> BoardInstant {
    BoardInstant { us, error_us: 0.0 }
}

proptest! {
    /// Between two readings of a steady motion the track is exact.
    #[test]
    fn steady_motion_is_interpolated(rate in -50..50i32, at in 0.0..90_000.0f64) {
        let mut track = JointTrack::new(100);
        for n in 0..10 {
            track.push(sample(n * 10_000, &[rate * n as i32, 7]));
        }
        let joints = track.at(instant(at)).expect("covered");
        prop_assert!((joints.counts[0] - f64::from(rate) * at / 10_000.0).abs() < 1e-9);
        prop_assert!((joints.counts[1] - 7.0).abs() < 1e-12);
    }
}

#[test]
fn the_track_says_what_it_does_not_know() {
    let mut track = JointTrack::new(3);
    assert_eq!(track.at(instant(0.0)), Err(TrackGap::NotYet));
    for at in [10_000, 20_000, 30_000, 40_000] {
        track.push(sample(at, &[0]));
    }
    assert_eq!(track.at(instant(40_001.0)), Err(TrackGap::NotYet));
    assert_eq!(track.at(instant(15_000.0)), Err(TrackGap::TooOld));
    assert!(track.at(instant(20_000.0)).is_ok());
    track.push(sample(200_000, &[0]));
    assert_eq!(track.at(instant(100_000.0)), Err(TrackGap::Gap(160.0)));
}

#[test]
fn a_board_that_begins_anew_begins_a_new_track() {
    let mut track = JointTrack::new(10);
    track.push(sample(1_000_000, &[5]));
    track.push(sample(1_010_000, &[5]));
    track.push(sample(3_000, &[0]));
    assert_eq!(track.at(instant(1_005_000.0)), Err(TrackGap::NotYet));
}

#[test]
fn an_uncertain_instant_costs_the_distance_moved_in_it() {
    let mut track = JointTrack::new(10);
    track.push(sample(0, &[0]));
    track.push(sample(10_000, &[1000]));
    let at = |error_us| track.at(BoardInstant { us: 5_000.0, error_us }).expect("covered");
    // One count, uniform: 1/√12. Plus or minus 100 us at 0.1 counts/us: 20 counts, uniform.
    assert!((at(0.0).sigma[0] - 1.0 / 12f64.sqrt()).abs() < 1e-12);
    assert!((at(0.0).timing[0]).abs() < 1e-12);
    assert!((at(100.0).sigma[0] - 1.0 / 12f64.sqrt()).abs() < 1e-12);
    assert!((at(100.0).timing[0] - 20.0 / 12f64.sqrt()).abs() < 1e-9);
}

/// Under constant acceleration the truth is off the straight line by what the track says.
#[test]
fn a_bend_of_the_motion_is_owned_up_to() {
    let mut track = JointTrack::new(10);
    for n in 0..6 {
        track.push(sample(n * 10_000, &[(50 * n * n) as i32]));
    }
    let joints = track.at(instant(25_000.0)).expect("covered");
    let truth = 50.0 * 2.5 * 2.5;
    let off = (joints.counts[0] - truth).abs();
    assert!((off - 12.5).abs() < 1e-9);
    assert!(joints.sigma[0] >= off && joints.sigma[0] < 1.01 * off, "{}", joints.sigma[0]);
}
