//! What the board remembers through a reset.
use proptest::prelude::*;
use vergence_image::{Death, SURVIVOR_WORDS, Survivor};

fn survivor() -> impl Strategy<Value = Survivor> {
    let death = prop_oneof![
        Just(None),
        ("[ -~]{0,40}", any::<u32>()).prop_map(|(file, line)| Some(Death::panic(&file, line))),
        any::<(u32, u32)>().prop_map(|(pc, lr)| Some(Death::hard_fault(pc, lr))),
    ];
    (any::<u32>(), any::<bool>(), any::<u32>(), death).prop_map(|(failed_starts, recovery_wanted, starts, death)| {
        Survivor { failed_starts, recovery_wanted, starts, death }
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
fn a_panic_keeps_the_end_of_the_file_name() {
    assert_eq!(Death::panic("a/very/long/way/to/firmware/control/src/axis.rs", 7).file(), "ware/control/src/axis.rs");
    assert_eq!(Death::panic("src/link.rs", 7).file(), "src/link.rs");
}
