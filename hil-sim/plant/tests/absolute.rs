//! The reader of the AS5048A beside the simulated one: what it reads, and what it refuses to read.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_control::{As5048a, TURN};
use vergence_plant::{As5048aChip, MagnetFault};
use vergence_protocol::{EncoderState, FaultCode};

/// Micro-units of a turn: a count is one.
const WHOLE: f64 = TURN as f64;

fn ask(reader: &mut As5048a, chip: &mut As5048aChip, position: f64) {
    reader.ask(|question| Some(chip.frame(question, position)));
}

fn settled(position: f64, mount: u16) -> (As5048a, As5048aChip) {
    let (mut reader, mut chip) = (As5048a::default(), As5048aChip::new(WHOLE, mount));
    (0..4).for_each(|_| ask(&mut reader, &mut chip, position));
    (reader, chip)
}

/// The words of the datasheet, computed by hand: the questions have odd counts of ones without parity, so that their top bit
/// is set.
#[test]
fn the_questions_are_those_of_the_datasheet() {
    let mut words = Vec::new();
    As5048a::default().ask(|word| {
        words.push(word);
        Some(0)
    });
    assert_eq!(words, [0xFFFF, 0x7FFD]);
}

/// An answer comes one frame late, with even parity; an error stays until its register was read.
#[test]
fn the_simulated_encoder_answers_as_the_datasheet_says() {
    let mut chip = As5048aChip::new(WHOLE, 0);
    assert_eq!(chip.frame(0xFFFF, 100.0), 0, "nothing was asked before");
    assert_eq!(chip.frame(0x7FFD, 200.0), 0x8000 | 100, "the angle at the end of the first frame, with parity");
    assert_eq!(chip.frame(0x7FFF, 0.0), 0x0180, "started, gain 128");
    assert_eq!(chip.frame(0xFFFF, 7.0) & 0x4000, 0x4000, "the question had bad parity");
    assert_eq!(chip.frame(0x4001, 7.0) & 0x4000, 0x4000, "not cleared yet");
    assert_eq!(chip.frame(0xFFFF, 7.0) & 0x3FFF, 4, "what was wrong: parity");
    assert_eq!(chip.frame(0xC000, 7.0) & 0x7FFF, 7);
}

#[test]
fn an_encoder_that_starts_late_is_read_once_it_answers() {
    let (mut reader, mut chip) = (As5048a::default(), As5048aChip::new(WHOLE, 0));
    chip.fail(Some(MagnetFault::Starting));
    (0..10).for_each(|_| ask(&mut reader, &mut chip, 50.0));
    assert!(!reader.state().is_usable());
    chip.fail(None);
    (0..4).for_each(|_| ask(&mut reader, &mut chip, 50.0));
    assert_eq!(reader.state(), EncoderState::Absolute { reading: 50, gain: 128 });
}

#[test]
fn a_bus_that_does_not_work_is_an_encoder_that_does_not_answer() {
    let (mut reader, _) = settled(50.0, 0);
    (0..6).for_each(|_| reader.ask(|_| None));
    assert_eq!(reader.state(), EncoderState::Failed(FaultCode::EncoderLost));
}

proptest! {
    /// Wherever the encoder stands and however it turns, the count follows without a jump.
    #[test]
    fn the_count_follows_over_many_turns(mount in 0u16..16_384, ways in prop::collection::vec(-8_000.0f64..8_000.0, 1..60)) {
        let mut position = 0.5;
        let (mut reader, mut chip) = settled(position, mount);
        for way in ways {
            let (before, from) = (reader.count(), position);
            position += way;
            ask(&mut reader, &mut chip, position);
            let moved = f64::from(reader.count() - before);
            prop_assert!((moved - (position.floor() - from.floor())).abs() < 0.5, "{moved} {way}");
            prop_assert_eq!(reader.count().rem_euclid(16_384), (position.floor() as i32 + i32::from(mount)).rem_euclid(16_384));
        }
    }

    /// One wrong bit in every answer, or in every question, never makes a wrong count: it is noticed within five ticks.
    #[test]
    fn a_wrong_bit_is_noticed_and_never_read(bit in 0u8..16, in_question in any::<bool>(), at in 0.0f64..16_000.0) {
        let (mut reader, mut chip) = settled(at, 0);
        let count = reader.count();
        chip.fail(Some(if in_question { MagnetFault::FlippedQuestion(bit) } else { MagnetFault::FlippedAnswer(bit) }));
        for _ in 0..6 {
            ask(&mut reader, &mut chip, at + 300.0);
            // The angle asked for before the trouble began may still come.
            prop_assert!(reader.count() == count || reader.count() - count == 300, "{}", reader.count());
        }
        prop_assert!(matches!(reader.state(), EncoderState::Failed(_)), "{:?}", reader.state());
    }
}
