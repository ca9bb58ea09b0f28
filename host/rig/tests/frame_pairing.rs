//! Frames and events find each other, whatever is lost on the way and in whatever order they arrive, or it is said that
//! nobody can tell.

use proptest::prelude::*;
use vergence_rig::{ExposureDelay, Fate, FramePairing, HostInstant, StampedFrame, TimedEvent};

const DELAY: ExposureDelay = ExposureDelay { least_us: 8_000.0, most_us: 20_000.0 };
const PERIOD: f64 = 50_000.0;
/// What the clock map and the driver's stamp are good for.
const EVENT_ERROR: f64 = 150.0;
const FRAME_ERROR: f64 = 4_000.0;

fn pulse(seq: u32) -> f64 {
    1e6 + f64::from(seq) * PERIOD
}

fn event(seq: u32) -> TimedEvent {
    TimedEvent { seq, at: HostInstant { us: pulse(seq), error_us: EVENT_ERROR } }
}

fn frame(seq: u32, delay: f64) -> StampedFrame {
    StampedFrame { seq, middle: HostInstant { us: pulse(seq) + delay, error_us: FRAME_ERROR } }
}

fn fates(pairing: &mut FramePairing) -> Vec<Fate> {
    std::iter::from_fn(|| pairing.take()).collect()
}

#[test]
fn a_lost_mark_and_a_lost_frame_shift_nothing() {
    let mut pairing = FramePairing::new(DELAY, PERIOD);
    [0, 1, 3, 4].into_iter().for_each(|seq| pairing.event(event(seq)));
    [0, 1, 2, 4].into_iter().for_each(|seq| pairing.frame(frame(seq, 12_000.0)));
    let paired = |seq| Fate::Paired { event: seq, frame: seq };
    assert_eq!(fates(&mut pairing), [paired(0), paired(1), Fate::EventAlone(3), paired(4)]);
    pairing.settle(f64::INFINITY);
    assert_eq!(fates(&mut pairing), [Fate::FrameAlone(2)]);
}

#[test]
fn a_frame_may_come_before_its_mark() {
    let mut pairing = FramePairing::new(DELAY, PERIOD);
    pairing.frame(frame(0, 12_000.0));
    assert_eq!(pairing.take(), None);
    pairing.event(event(0));
    assert_eq!(pairing.take(), Some(Fate::Paired { event: 0, frame: 0 }));
}

#[test]
fn a_guess_is_not_made() {
    // Five times as often: another pulse, whose mark may be on its way, would fit as well.
    let mut pairing = FramePairing::new(DELAY, PERIOD / 5.0);
    assert!(pairing.excess_us(&frame(0, 12_000.0), EVENT_ERROR).is_some());
    pairing.event(event(0));
    pairing.frame(frame(0, 12_000.0));
    assert_eq!(fates(&mut pairing), [Fate::Ambiguous(0)]);
    // One by one, the caller knows that there is no other.
    let mut pairing = FramePairing::new(DELAY, f64::INFINITY);
    pairing.event(event(0));
    pairing.frame(frame(0, 12_000.0));
    assert_eq!(fates(&mut pairing), [Fate::Paired { event: 0, frame: 0 }]);
    assert_eq!(pairing.excess_us(&frame(0, 12_000.0), EVENT_ERROR), None);
}

#[test]
fn a_board_that_begins_anew_forgets_its_pulses() {
    let mut pairing = FramePairing::new(DELAY, PERIOD);
    pairing.event(event(7));
    let first = TimedEvent { seq: 0, ..event(20) };
    pairing.event(first);
    pairing.frame(StampedFrame { seq: 3, ..frame(20, 10_000.0) });
    assert_eq!(fates(&mut pairing), [Fate::EventAlone(7), Fate::Paired { event: 0, frame: 3 }]);
}

/// What happens to one pulse: whether mark and frame arrive, its true delay, how far the driver's stamp is off, and when each
/// arrives.
type Story = (bool, bool, f64, f64, f64, f64);

fn story() -> impl Strategy<Value = Story> {
    let delay = DELAY.least_us..=DELAY.most_us;
    let late = 0.0..400_000.0f64;
    (any::<bool>(), any::<bool>(), delay, -3_999.0..3_999.0f64, late.clone(), late)
}

#[derive(Clone, Copy)]
enum Arrival {
    Mark(TimedEvent),
    Frame(StampedFrame),
}

/// All that arrives, in an order in which frames stay behind frames and marks behind marks.
fn arrivals(stories: &[Story], period: f64, clock_error: f64) -> Vec<Arrival> {
    let (mut all, mut latest): (Vec<(f64, Arrival)>, [f64; 2]) = (Vec::new(), [0.0; 2]);
    for (seq, &(marked, seen, delay, stamp, mark_late, frame_late)) in (0u32..).zip(stories) {
        let at = 1e6 + f64::from(seq) * period;
        latest = [latest[0].max(at + mark_late), latest[1].max(at + delay + frame_late)];
        if marked {
            let at = HostInstant { us: at + clock_error, error_us: EVENT_ERROR };
            all.push((latest[0], Arrival::Mark(TimedEvent { seq, at })));
        }
        if seen {
            let middle = HostInstant { us: at + delay + stamp, error_us: FRAME_ERROR };
            all.push((latest[1], Arrival::Frame(StampedFrame { seq, middle })));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, arrival)| arrival).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// At any rate of the trigger, and whatever is lost: no frame is ever paired with a pulse that is not its own, each has one
    /// fate, and where the rate is slow enough every pair that can be made is made.
    #[test]
    fn no_frame_is_paired_with_another_s_pulse(
        stories in prop::collection::vec(story(), 1..40),
        period in 3_000.0..120_000.0f64,
        clock_error in -149.0..149.0f64,
    ) {
        let mut pairing = FramePairing::new(DELAY, period);
        let mut found = Vec::new();
        let mut clear = true;
        for arrival in arrivals(&stories, period, clock_error) {
            match arrival {
                Arrival::Mark(mark) => pairing.event(mark),
                Arrival::Frame(frame) => {
                    clear &= pairing.excess_us(&frame, EVENT_ERROR).is_none();
                    pairing.frame(frame);
                }
            }
            found.extend(fates(&mut pairing));
        }
        pairing.settle(f64::INFINITY);
        found.extend(fates(&mut pairing));
        let (mut frames, mut events, mut pairs) = (0, 0, 0);
        for fate in &found {
            match fate {
                Fate::Paired { event, frame } => {
                    prop_assert_eq!(event, frame);
                    (pairs, frames, events) = (pairs + 1, frames + 1, events + 1);
                }
                Fate::FrameAlone(_) => frames += 1,
                Fate::Ambiguous(_) => {
                    prop_assert!(!clear);
                    frames += 1;
                }
                Fate::EventAlone(_) => events += 1,
            }
        }
        prop_assert_eq!(frames, stories.iter().filter(|story| story.1).count());
        prop_assert_eq!(events, stories.iter().filter(|story| story.0).count());
        if clear {
            prop_assert_eq!(pairs, stories.iter().filter(|story| story.0 && story.1).count());
        }
    }
}
