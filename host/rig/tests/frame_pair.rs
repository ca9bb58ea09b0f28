//! Frames and trigger pulses find each other, whatever is lost on the way.

use proptest::prelude::*;
use vergence_protocol::{AxisList, FrameMark, Microseconds};
use vergence_rig::{ClockMap, Exchange, PairingError, StampedFrame, TriggerDelay, pair_frames};

const DELAY: TriggerDelay = TriggerDelay { least_us: 8_000, most_us: 20_000 };
const PERIOD: u64 = 50_000;
/// The board's clock is this far ahead of the host's.
const AHEAD: u64 = 3_000_000;

fn clock() -> ClockMap {
    let mut clock = ClockMap::default();
    for probe in 0..20 {
        let t0 = probe * 100_000;
        clock.probe_sent();
        let at = |us| Microseconds(us);
        clock.observe(Exchange { t0: at(t0), t1: at(t0 + AHEAD + 100), t2: at(t0 + AHEAD + 120), t3: at(t0 + 220) });
    }
    clock
}

fn mark(seq: u32) -> FrameMark {
    FrameMark { seq, at: Microseconds(AHEAD + u64::from(seq) * PERIOD), counts: AxisList::new() }
}

fn frame(seq: u32, delay: u64) -> StampedFrame {
    StampedFrame { seq, at: Microseconds(u64::from(seq) * PERIOD + delay) }
}

#[test]
fn a_lost_mark_and_a_lost_frame_shift_nothing() {
    let marks = [0, 1, 3, 4].map(mark);
    let frames = [0, 1, 2, 4].map(|seq| frame(seq, 12_000));
    let pairing = pair_frames(&frames, &marks, &clock(), DELAY).expect("it is clear");
    let pairs: Vec<_> = pairing.pairs.iter().map(|pair| (pair.frame, pair.mark)).collect();
    assert_eq!(pairs, [(0, 0), (1, 1), (3, 3)]);
    assert_eq!((pairing.frames_without_mark, pairing.marks_without_frame), (vec![2], vec![2]));
    assert_eq!((pairing.marks_lost, pairing.frames_lost), (1, 1));
}

#[test]
fn a_guess_is_refused() {
    let near = [FrameMark { at: Microseconds(AHEAD + 11_000), ..mark(1) }];
    let marks = [&[mark(0)][..], &near].concat();
    let refused = pair_frames(&[], &marks, &clock(), DELAY);
    assert!(matches!(refused, Err(PairingError::Ambiguous { .. })), "{refused:?}");
    assert_eq!(pair_frames(&[], &marks, &ClockMap::default(), DELAY), Err(PairingError::NoClock));
}

proptest! {
    #[test]
    fn whatever_arrives_is_paired_with_its_own_pulse(
        fates in prop::collection::vec((any::<bool>(), any::<bool>(), DELAY.least_us..=DELAY.most_us), 1..40),
    ) {
        let numbered = || (0u32..).zip(&fates);
        let marks: Vec<_> = numbered().filter(|(_, fate)| fate.0).map(|(seq, _)| mark(seq)).collect();
        let frames: Vec<_> = numbered().filter(|(_, fate)| fate.1).map(|(seq, fate)| frame(seq, fate.2)).collect();
        let pairing = pair_frames(&frames, &marks, &clock(), DELAY).expect("it is clear");
        for pair in &pairing.pairs {
            prop_assert_eq!(frames[pair.frame].seq, marks[pair.mark].seq);
            let truth = frames[pair.frame].at.0 as f64 - f64::from(marks[pair.mark].seq) * PERIOD as f64;
            prop_assert!((pair.delay_us - truth).abs() <= pair.error_us);
        }
        let both = fates.iter().filter(|fate| fate.0 && fate.1).count();
        prop_assert_eq!(pairing.pairs.len(), both);
        prop_assert_eq!(pairing.pairs.len() + pairing.frames_without_mark.len(), frames.len());
        prop_assert_eq!(pairing.pairs.len() + pairing.marks_without_frame.len(), marks.len());
    }
}
