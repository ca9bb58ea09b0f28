//! What the board remembers through a reset.
use proptest::option;
use proptest::prelude::*;
use vergence_image::{Death, DeathKind, SURVIVOR_WORDS, Survivor, TRACE};

fn survivor() -> impl Strategy<Value = Survivor> {
    let kind = prop_oneof![
        Just(DeathKind::Panic),
        Just(DeathKind::HardFault),
        Just(DeathKind::Settings),
        Just(DeathKind::SerialLine),
    ];
    let death = option::of((kind, any::<[u32; TRACE]>()).prop_map(|(kind, trace)| Death { kind, trace }));
    (any::<u32>(), any::<[bool; 2]>(), any::<u32>(), death).prop_map(|(failed_starts, wanted, starts, death)| {
        let [recovery_wanted, defaults_wanted] = wanted;
        Survivor { failed_starts, recovery_wanted, defaults_wanted, starts, death }
    })
}

proptest! {
    #[test]
    fn it_remembers(survivor in survivor()) {
        prop_assert_eq!(Survivor::from_words(&survivor.to_words()), survivor);
    }

    #[test]
    fn a_damaged_memory_is_no_memory(survivor in survivor(), word in 0..SURVIVOR_WORDS, bit in 0..32_u32) {
        let mut words = survivor.to_words();
        words[word] ^= 1 << bit;
        prop_assert_eq!(Survivor::from_words(&words), Survivor::default());
    }
}

#[test]
fn memory_after_power_on_is_none() {
    assert_eq!(Survivor::from_words(&[0; SURVIVOR_WORDS]), Survivor::default());
    assert_eq!(Survivor::from_words(&[u32::MAX; SURVIVOR_WORDS]), Survivor::default());
}

#[test]
fn a_trace_ends_before_its_zeros() {
    let death = |trace| Death { kind: DeathKind::Panic, trace };
    assert_eq!(death([7, 9, 0, 0, 0, 0, 0, 0]).trace(), [7, 9]);
    assert_eq!(death([1; TRACE]).trace(), [1; TRACE]);
}
