//! Interpolation of the stream of encoder readings.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_protocol::{AxisList, Counts, Microseconds};
use vergence_rig::{BoardInstant, JointSample, JointTrack, Joints, JointsAt, SteadyMotion, TrackGap};

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

/// Readings of steady motions are rounded. What is between two of them is as uncertain as stated, standing and moving.
#[test]
fn rounding_is_as_large_as_stated() {
    let mean_square = |rate: std::ops::Range<f64>| {
        let (mut squares, trials) = (0.0, 20_000);
        for trial in 0..trials {
            // Fractions of multiples of irrational numbers are evenly spread.
            let [phase, speed, share] =
                [2f64.sqrt(), 3f64.sqrt(), 5f64.sqrt()].map(|root| (f64::from(trial) * root).fract());
            let rate = rate.start + speed * (rate.end - rate.start);
            let truth = |readings: f64| phase + rate * readings;
            let mut track = JointTrack::new(4);
            for n in 0..4u8 {
                track.push(sample(10_000 * u64::from(n), &[truth(f64::from(n)).round() as i32]));
            }
            let joints = track.at(instant(10_000.0 * (1.0 + share))).expect("covered");
            squares += ((joints.counts[0] - truth(1.0 + share)) / joints.sigma[0]).powi(2);
        }
        squares / f64::from(trials)
    };
    let (standing, moving) = (mean_square(0.0..1e-9), mean_square(3.0..40.0));
    assert!((0.97..1.03).contains(&standing), "standing {standing}");
    // The change of a step by one count is taken for a change of speed too.
    assert!((0.85..1.03).contains(&moving), "moving {moving}");
}

#[test]
fn instants_outside_the_track_are_refused() {
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
fn a_part_of_the_track_interpolates_alike() {
    let mut track = JointTrack::new(100);
    for n in 0..50i32 {
        track.push(sample(1_000_000 + 2_000 * n as u64, &[n * n, -3 * n]));
    }
    let part = track.between(1_020_500.0, 1_039_000.0);
    for us in [1_020_500.0, 1_025_000.0, 1_030_001.0, 1_039_000.0] {
        assert_eq!(part.at(instant(us)), track.at(instant(us)));
    }
    assert_eq!(part.at(instant(1_010_000.0)), Err(TrackGap::TooOld));
    assert_eq!(track.between(2e6, 3e6).at(instant(2.5e6)), Err(TrackGap::NotYet));
    assert_eq!(JointTrack::new(5).between(0.0, 1.0).at(instant(0.5)), Err(TrackGap::NotYet));
}

#[test]
fn steady_motion_continues_at_its_rates() {
    let joints = JointsAt { counts: vec![100.0, 7.0], sigma: vec![0.5, 0.0], timing: vec![0.0, 0.0] };
    let motion = SteadyMotion { from_us: 1e6, joints, rates: vec![-0.25, 0.0] };
    let later = motion.at(BoardInstant { us: 1e6 + 400.0, error_us: 12f64.sqrt() }).expect("it is said");
    assert_eq!((later.counts, later.sigma), (vec![0.0, 7.0], vec![0.5, 0.0]));
    // Uniform over plus or minus 12^½ us: one and two of them.
    assert!((later.timing[0] + 0.5).abs() < 1e-12 && later.timing[1].abs() < 1e-12);
}

#[test]
fn a_restarted_board_begins_a_new_track() {
    let mut track = JointTrack::new(10);
    track.push(sample(1_000_000, &[5]));
    track.push(sample(1_010_000, &[5]));
    track.push(sample(3_000, &[0]));
    assert_eq!(track.at(instant(1_005_000.0)), Err(TrackGap::NotYet));
}

#[test]
fn an_uncertain_instant_adds_the_distance_moved_in_it() {
    let mut track = JointTrack::new(10);
    track.push(sample(0, &[0]));
    track.push(sample(10_000, &[1000]));
    let at = |error_us| track.at(BoardInstant { us: 5_000.0, error_us }).expect("covered");
    // One count, uniform, in each of two readings: 1/√12, and 1/√2 of it in their mean. Plus or minus 100 us at 0.1 counts/us: 20 counts, uniform.
    assert!((at(0.0).sigma[0] - 1.0 / 24f64.sqrt()).abs() < 1e-12);
    assert!((at(0.0).timing[0]).abs() < 1e-12);
    assert!((at(100.0).sigma[0] - 1.0 / 24f64.sqrt()).abs() < 1e-12);
    assert!((at(100.0).timing[0] - 20.0 / 12f64.sqrt()).abs() < 1e-9);
}

/// Under constant acceleration the track's sigma covers the deviation from linear motion.
#[test]
fn accelerated_motion_widens_the_sigma() {
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
