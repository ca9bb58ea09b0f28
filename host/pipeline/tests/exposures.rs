//! Which images belong together: what is lost is counted, what is uncertain is not guessed.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::time::Duration;

use vergence_pipeline::{Ambiguity, CameraGone, Exposed, Exposures, SkipReason, TimeBase};
use vergence_protocol::{AxisList, Microseconds, TriggerMark};
use vergence_rig::{ClockMap, Exchange, ExposureTiming, HostInstant, StampedImage};
use vergence_vision::Side;

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A board whose clock is `ahead_us` ahead of the host's.
fn board(ahead_us: u64) -> TimeBase {
    let mut clock = ClockMap::default();
    let [t0, t1] = [Microseconds(500_000), Microseconds(500_000 + ahead_us)];
    clock.observe(Exchange { t0, t1, t2: t1, t3: t0 });
    TimeBase::Board(clock)
}

/// The stamp of the image that belongs to pulse `number`.
fn stamp_of(number: u32, seq: u32) -> StampedImage {
    StampedImage { seq, middle: HostInstant { us: 1e6 + f64::from(number) * 1e5 + 2_500.0, error_us: 1_000.0 } }
}

fn mark(seq: u32) -> TriggerMark {
    TriggerMark { seq, at: Microseconds(1_000_000 + 100_000 * u64::from(seq)), counts: AxisList::new() }
}

/// A camera that comes back holds nothing up, and what it missed is not waited for.
#[test]
fn exposures_go_on_when_a_camera_dies_and_comes_back() {
    let base = board(0);
    let timing = ExposureTiming { period: ms(33), exposure: Some(ms(4)), rolling: ms(0), readout: ms(8) };
    let mut exposures = Exposures::new(Some(1e5));
    assert_eq!(exposures.gone(), [Some(&CameraGone::Unknown); 2]);
    exposures.camera_ready(Side::Left, timing, &base);
    exposures.camera_ready(Side::Right, timing, &base);
    assert_eq!(exposures.gone(), [None, None]);
    exposures.pulse(&mark(0), &base);
    exposures.image(Side::Left, stamp_of(0, 0), "left 0", &base);
    assert!(exposures.take().is_none(), "half a pair");
    exposures.image(Side::Right, stamp_of(0, 7), "right 7", &base);
    let Some(Exposed::Pair(images)) = exposures.take() else { panic!("a pair") };
    assert_eq!((images[0].image, images[1].image), ("left 0", "right 7"));
    // Half the exposure after the edge, and the camera's reaction of up to a millisecond.
    assert_eq!((images[0].middle.us, images[0].middle.error_us), (1_002_500.0, 500.0));

    exposures.pulse(&mark(1), &base);
    exposures.image(Side::Right, stamp_of(1, 8), "right 8", &base);
    exposures.camera_failed(Side::Left, "the cable".into(), &base);
    let Some(Exposed::One { side: Side::Right, why, .. }) = exposures.take() else { panic!("the right camera lives") };
    assert_eq!(why, CameraGone::Failed("the cable".into()));
    exposures.pulse(&mark(2), &base);
    exposures.camera_ready(Side::Left, timing, &base);
    exposures.image(Side::Right, stamp_of(2, 9), "right 9", &base);
    assert!(exposures.take().is_none(), "its left image was never taken, and both are there");
    exposures.pulse(&mark(3), &base);
    exposures.image(Side::Left, stamp_of(3, 0), "left 0", &base);
    exposures.image(Side::Right, stamp_of(3, 10), "right 10", &base);
    assert!(matches!(exposures.take(), Some(Exposed::Pair(_))));
    // An image that is lost is counted when the next one comes.
    exposures.pulse(&mark(4), &base);
    exposures.image(Side::Left, stamp_of(4, 1), "left 1", &base);
    exposures.pulse(&mark(5), &base);
    exposures.image(Side::Right, stamp_of(5, 12), "right 12", &base);
    exposures.image(Side::Left, stamp_of(5, 2), "left 2", &base);
    assert!(matches!(exposures.take(), Some(Exposed::Pair(_))));
    assert_eq!(exposures.skipped().get(&SkipReason::RightImageLost), Some(&1));
}

/// At a rate at which images cannot be told apart nothing is guessed, and it is reported once.
#[test]
fn images_that_time_cannot_tell_apart_are_reported() {
    let base = board(0);
    let timing = ExposureTiming { period: ms(240), exposure: None, rolling: ms(0), readout: ms(240) };
    let mut exposures = Exposures::new(Some(1e5));
    for side in [Side::Left, Side::Right] {
        exposures.camera_ready(side, timing, &base);
    }
    for number in 0..3 {
        exposures.pulse(&mark(number), &base);
        exposures.image(Side::Left, stamp_of(number, number), (), &base);
        exposures.image(Side::Right, stamp_of(number, number), (), &base);
    }
    assert!(exposures.take().is_none());
    assert_eq!(exposures.skipped().get(&SkipReason::ImageOfEitherPulse), Some(&6));
    let Some(Ambiguity { side: Side::Left, excess_us }) = exposures.take_ambiguity() else { panic!("an ambiguity") };
    // The middle lies 0 to 120 ms after the start, the reaction adds 1 ms and the stamp twice 1 ms; pulses are 100 ms apart.
    assert!((excess_us - 23_000.0).abs() < 1e-6, "{excess_us}");
    assert_eq!(exposures.take_ambiguity(), None);
}

/// Free-running cameras are paired by their stamps; the instants come on the clock of the board.
#[test]
fn free_running_images_are_paired_by_their_stamps() {
    let timing = ExposureTiming { period: ms(100), exposure: Some(ms(4)), rolling: ms(0), readout: ms(8) };
    let mut exposures = Exposures::new(None);
    let base = board(1_000);
    exposures.camera_ready(Side::Left, timing, &base);
    exposures.camera_ready(Side::Right, timing, &base);
    for number in 0..3 {
        exposures.image(Side::Left, stamp_of(number, number), number, &base);
        if number != 1 {
            exposures.image(Side::Right, stamp_of(number, number + 40), number + 40, &base);
        }
    }
    for expected in [0, 2] {
        let Some(Exposed::Pair(images)) = exposures.take() else { panic!("pair {expected}") };
        assert_eq!((images[0].image, images[1].image), (expected, expected + 40));
        assert!((images[0].middle.us - (1e6 + f64::from(expected) * 1e5 + 3_500.0)).abs() < 1.0);
    }
    assert!(exposures.take().is_none());
    assert_eq!(exposures.skipped().get(&SkipReason::RightImageLost), Some(&1));
    // The right camera fails: what the left one delivers goes on alone.
    exposures.camera_failed(Side::Right, "the cable".into(), &base);
    exposures.image(Side::Left, stamp_of(3, 3), 3, &base);
    assert!(matches!(exposures.take(), Some(Exposed::One { side: Side::Left, .. })));
}

/// Where the link to the board ended, images of triggered cameras are paired by their stamps, and by pulses again when it is back.
#[test]
fn images_are_paired_without_a_link_and_with_it_again() {
    let base = board(0);
    let timing = ExposureTiming { period: ms(33), exposure: Some(ms(4)), rolling: ms(0), readout: ms(8) };
    let mut exposures = Exposures::new(Some(1e5));
    for side in [Side::Left, Side::Right] {
        exposures.camera_ready(side, timing, &base);
    }
    exposures.image(Side::Left, stamp_of(0, 0), 0, &base);
    exposures.link_ended();
    assert_eq!(exposures.skipped().get(&SkipReason::ImageWithoutPulse), Some(&1), "its pulse was not reported");
    for number in 1..4 {
        exposures.image(Side::Left, stamp_of(number, number), number, &base);
        exposures.image(Side::Right, stamp_of(number, number), number + 40, &base);
    }
    // Like those of free-running cameras, the last ones wait for what may come.
    for expected in 1..3 {
        let Some(Exposed::Pair(images)) = exposures.take() else { panic!("pair {expected}") };
        assert_eq!((images[0].image, images[1].image), (expected, expected + 40));
        // As well as stamps and clock are known.
        assert!(images[0].middle.error_us > 999.0);
    }
    exposures.settle(Microseconds(2_000_000), &base);
    assert!(matches!(exposures.take(), Some(Exposed::Pair(_))));
    exposures.link_back();
    exposures.pulse(&mark(0), &base);
    exposures.image(Side::Left, stamp_of(0, 4), 4, &base);
    assert!(exposures.take().is_none());
    exposures.image(Side::Right, stamp_of(0, 4), 44, &base);
    let Some(Exposed::Pair(images)) = exposures.take() else { panic!("a pair") };
    assert_eq!((images[0].image, images[0].middle.error_us), (4, 500.0), "by its pulse");
    assert_eq!(exposures.gone(), [None, None]);
}
