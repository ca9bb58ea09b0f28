//! Images and events are paired whatever is lost on the way and in whatever order they arrive, or are reported as
//! ambiguous.

use proptest::prelude::*;
use vergence_rig::{ExposureDelay, HostInstant, ImagePairing, PairingOutcome, StampedImage, TimedEvent};

const DELAY: ExposureDelay = ExposureDelay { least_us: 8_000.0, most_us: 20_000.0 };
const PERIOD: f64 = 50_000.0;
/// What the clock map and the driver's stamp are good for.
const EVENT_ERROR: f64 = 150.0;
const IMAGE_ERROR: f64 = 4_000.0;

fn pulse(seq: u32) -> f64 {
    1e6 + f64::from(seq) * PERIOD
}

fn event(seq: u32) -> TimedEvent {
    TimedEvent { seq, at: HostInstant { us: pulse(seq), error_us: EVENT_ERROR } }
}

fn image(seq: u32, delay: f64) -> StampedImage {
    StampedImage { seq, middle: HostInstant { us: pulse(seq) + delay, error_us: IMAGE_ERROR } }
}

fn fates(pairing: &mut ImagePairing) -> Vec<PairingOutcome> {
    std::iter::from_fn(|| pairing.take()).collect()
}

#[test]
fn a_lost_mark_and_a_lost_image_shift_nothing() {
    let mut pairing = ImagePairing::new(DELAY, PERIOD);
    [0, 1, 3, 4].into_iter().for_each(|seq| pairing.event(event(seq)));
    [0, 1, 2, 4].into_iter().for_each(|seq| pairing.image(image(seq, 12_000.0)));
    let paired = |seq| PairingOutcome::Paired { event: seq, image: seq };
    assert_eq!(fates(&mut pairing), [paired(0), paired(1), PairingOutcome::EventAlone(3), paired(4)]);
    pairing.settle(f64::INFINITY);
    assert_eq!(fates(&mut pairing), [PairingOutcome::ImageAlone(2)]);
}

#[test]
fn an_image_may_come_before_its_mark() {
    let mut pairing = ImagePairing::new(DELAY, PERIOD);
    pairing.image(image(0, 12_000.0));
    assert_eq!(pairing.take(), None);
    pairing.event(event(0));
    assert_eq!(pairing.take(), Some(PairingOutcome::Paired { event: 0, image: 0 }));
}

#[test]
fn a_guess_is_not_made() {
    // Five times as often: another pulse, whose mark may be on its way, would fit as well.
    let mut pairing = ImagePairing::new(DELAY, PERIOD / 5.0);
    assert!(pairing.excess_us(&image(0, 12_000.0), EVENT_ERROR).is_some());
    pairing.event(event(0));
    pairing.image(image(0, 12_000.0));
    assert_eq!(fates(&mut pairing), [PairingOutcome::Ambiguous(0)]);
    // One by one, the caller knows that there is no other.
    let mut pairing = ImagePairing::new(DELAY, f64::INFINITY);
    pairing.event(event(0));
    pairing.image(image(0, 12_000.0));
    assert_eq!(fates(&mut pairing), [PairingOutcome::Paired { event: 0, image: 0 }]);
    assert_eq!(pairing.excess_us(&image(0, 12_000.0), EVENT_ERROR), None);
}

#[test]
fn a_board_that_begins_anew_forgets_its_pulses() {
    let mut pairing = ImagePairing::new(DELAY, PERIOD);
    pairing.event(event(7));
    let first = TimedEvent { seq: 0, ..event(20) };
    pairing.event(first);
    pairing.image(StampedImage { seq: 3, ..image(20, 10_000.0) });
    assert_eq!(fates(&mut pairing), [PairingOutcome::EventAlone(7), PairingOutcome::Paired { event: 0, image: 3 }]);
}

/// What happens to one pulse: whether mark and image arrive, the true delay, the error of the driver's stamp, and the
/// delay of each arrival.
type Story = (bool, bool, f64, f64, f64, f64);

fn story() -> impl Strategy<Value = Story> {
    let delay = DELAY.least_us..=DELAY.most_us;
    let late = 0.0..400_000.0f64;
    (any::<bool>(), any::<bool>(), delay, -3_999.0..3_999.0f64, late.clone(), late)
}

#[derive(Clone, Copy)]
enum Arrival {
    Mark(TimedEvent),
    Image(StampedImage),
}

/// All arrivals, in an order in which images stay behind images and marks behind marks.
fn arrivals(stories: &[Story], period: f64, clock_error: f64) -> Vec<Arrival> {
    let (mut all, mut latest): (Vec<(f64, Arrival)>, [f64; 2]) = (Vec::new(), [0.0; 2]);
    for (seq, &(marked, seen, delay, stamp, mark_late, image_late)) in (0u32..).zip(stories) {
        let at = 1e6 + f64::from(seq) * period;
        latest = [latest[0].max(at + mark_late), latest[1].max(at + delay + image_late)];
        if marked {
            let at = HostInstant { us: at + clock_error, error_us: EVENT_ERROR };
            all.push((latest[0], Arrival::Mark(TimedEvent { seq, at })));
        }
        if seen {
            let middle = HostInstant { us: at + delay + stamp, error_us: IMAGE_ERROR };
            all.push((latest[1], Arrival::Image(StampedImage { seq, middle })));
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, arrival)| arrival).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// At any rate of the trigger, and whatever is lost: no image is paired with another image's pulse, each has one fate,
    /// and where the rate is slow enough every pair that can be made is made.
    #[test]
    fn no_image_is_paired_with_another_s_pulse(
        stories in prop::collection::vec(story(), 1..40),
        period in 3_000.0..120_000.0f64,
        clock_error in -149.0..149.0f64,
    ) {
        let mut pairing = ImagePairing::new(DELAY, period);
        let mut found = Vec::new();
        let mut clear = true;
        for arrival in arrivals(&stories, period, clock_error) {
            match arrival {
                Arrival::Mark(mark) => pairing.event(mark),
                Arrival::Image(image) => {
                    clear &= pairing.excess_us(&image, EVENT_ERROR).is_none();
                    pairing.image(image);
                }
            }
            found.extend(fates(&mut pairing));
        }
        pairing.settle(f64::INFINITY);
        found.extend(fates(&mut pairing));
        let (mut images, mut events, mut pairs) = (0, 0, 0);
        for fate in &found {
            match fate {
                PairingOutcome::Paired { event, image } => {
                    prop_assert_eq!(event, image);
                    (pairs, images, events) = (pairs + 1, images + 1, events + 1);
                }
                PairingOutcome::ImageAlone(_) => images += 1,
                PairingOutcome::Ambiguous(_) => {
                    prop_assert!(!clear);
                    images += 1;
                }
                PairingOutcome::EventAlone(_) => events += 1,
            }
        }
        prop_assert_eq!(images, stories.iter().filter(|story| story.1).count());
        prop_assert_eq!(events, stories.iter().filter(|story| story.0).count());
        if clear {
            prop_assert_eq!(pairs, stories.iter().filter(|story| story.0 && story.1).count());
        }
    }
}
