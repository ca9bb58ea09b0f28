//! Modes: their numbers are stable, and the mode that a board reports is checked.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use vergence_protocol::{
    AxisMask, ControllerState, Counts, Microseconds, Mode as ModeNumber, MoveId, MovePhase, PoseReport,
};
use vergence_rig::{BENCH_TOML, Mode, Provenance, Rig};

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench")
}

/// The bench with further `modes` in its file.
fn bench_with(modes: &str) -> Result<Rig, String> {
    Rig::from_toml(&BENCH_TOML.replacen("[modes.herbivore]", &format!("{modes}\n[modes.herbivore]"), 1))
        .map_err(|error| error.to_string())
}

/// The bench as rig files were before modes had numbers, with further `modes`.
fn unnumbered_bench_with(modes: &str) -> Rig {
    let text = BENCH_TOML.replace("number = 1\n", "").replace("number = 2\n", "");
    let text = text.replacen("[modes.herbivore]", &format!("{modes}\n[modes.herbivore]"), 1);
    Rig::from_toml(&text).expect("a rig")
}

/// The table of a mode whose pose is between the others.
fn table(name: &str, number: &str) -> String {
    format!("[modes.{name}]\n{number}\nbaseline = \"120mm\"\nseparation = \"60deg\"\n")
}

fn number_of(rig: &Rig, name: &str) -> u8 {
    rig.mode(name).expect("a mode").number.0
}

/// A board at rest that reports `mode` where the rig file puts the mode called `at`.
fn report(rig: &Rig, mode: ModeNumber, at: &str) -> PoseReport {
    let targets = &rig.mode(at).expect("a mode").targets;
    let counts = rig.axes.iter().zip(targets).map(|(axis, at)| Counts(axis.counts_at(at.value()).round() as i32));
    PoseReport {
        at: Microseconds(0),
        seq: 0,
        counts: counts.collect(),
        referenced: AxisMask(0b11),
        state: ControllerState::Idle,
        mode,
        move_id: MoveId(1),
        phase: MovePhase::Settled,
        fault: None,
    }
}

#[test]
fn modes_have_numbers_and_names() {
    let rig = bench();
    for (name, number) in [("herbivore", 1), ("human", 2)] {
        let mode = rig.mode(name).expect("a mode");
        assert_eq!(mode.number.0, number);
        let reported = rig.reported_mode(&report(&rig, mode.number, name)).expect("a mode");
        assert_eq!(reported.to_string(), name);
    }
    let wire = rig.wire_targets(&rig.mode("herbivore").expect("a mode").targets);
    assert_eq!(wire.iter().map(|target| target.0).collect::<Vec<_>>(), [145_000, 2_094_395]);
    assert_eq!(rig.reported_mode(&report(&rig, ModeNumber(0), "human")), None);
}

#[test]
fn a_mode_added_to_a_rig_file_renumbers_none() {
    let before = unnumbered_bench_with("");
    // In front of both in the alphabet.
    let after = unnumbered_bench_with(&table("cat", ""));
    for name in ["herbivore", "human"] {
        assert_eq!(number_of(&after, name), number_of(&before, name), "{name}");
    }
    // These numbers are in boards and in recordings: they must never change.
    assert_eq!(["cat", "herbivore", "human"].map(|name| number_of(&after, name)), [71, 203, 58]);
    assert!((0..2000).all(|name| Mode::number_from_name(&format!("mode {name}")).0 >= 32));
}

#[test]
fn numbers_are_written_and_read_again() {
    let rig = bench_with(&(table("cat", "number = 7") + &table("owl", ""))).expect("a rig");
    assert_eq!(["cat", "owl", "herbivore", "human"].map(|name| number_of(&rig, name)), [7, 69, 1, 2]);
    let provenance = Provenance { program: "test".into(), inputs_sha256: String::new(), date: None };
    let text = rig.to_toml(&provenance).expect("TOML");
    assert_eq!(Rig::from_toml(&text).expect("a rig").modes, rig.modes);
    assert!(text.contains("number = 69"), "{text}");
}

#[test]
fn wrong_numbers_are_refused() {
    let refused = |modes: &str, words: &[&str]| {
        let error = bench_with(modes).expect_err(modes);
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    refused(&table("cat", "number = 2"), &["'cat' and 'human' both have number 2"]);
    // These two names derive the same number.
    refused(&(table("lynx", "") + &table("cow", "")), &["cow", "lynx", "240", "write `number = N`"]);
    assert!(bench_with(&(table("lynx", "number = 3") + &table("cow", ""))).is_ok());
    // The one to change is the one that has no number in the file.
    refused(&(table("cow", "") + &table("lynx", "number = 240")), &["under [modes.cow]"]);
    for number in ["0", "256", "-1", "\"3\""] {
        refused(&table("cat", &format!("number = {number}")), &["'cat'", "from 1 to 255"]);
    }
    refused(&table("cat", "number = 1.5"), &["number = 1"]);
    refused(
        "[[axis]]\nname = \"number\"\nkind = \"linear\"\nrange = [\"0mm\", \"1mm\"]\ncounts_per_metre = 1\n",
        &["cannot be called"],
    );
}

#[test]
fn a_reported_mode_has_no_other_modes_name() {
    let rig = bench();
    let reported = |number, at| rig.reported_mode(&report(&rig, ModeNumber(number), at)).expect("a mode").to_string();
    assert_eq!(reported(7, "human"), "mode 7, not in this rig file");
    // The board was sent there with a rig file that numbers its modes otherwise.
    assert_eq!(reported(1, "human"), "mode 1, not where this rig file puts 'herbivore'");
}
