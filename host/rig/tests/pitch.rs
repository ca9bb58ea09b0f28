//! The table of pitch errors: there and back, and what is refused.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_rig::{PitchTable, PitchTableError, Provenance, Rig, RigPose};

const BENCH: &str = include_str!("../src/bench.toml");

fn bench(table: &str) -> Result<Rig, String> {
    let text = BENCH.replacen("counts_per_metre", &format!("pitch_error = {table}\ncounts_per_metre"), 1);
    Rig::from_toml(&text).map_err(|error| error.to_string())
}

fn baseline(pose: &RigPose) -> f64 {
    pose.left_from_right.origin().mm().norm()
}

#[test]
fn a_pose_is_where_the_table_says_and_targets_go_where_the_encoder_must() {
    let plain = Rig::from_toml(BENCH).expect("the bench");
    let rig = bench(r#"[["60mm", "0um"], ["160mm", "100um"], ["220mm", "-20um"]]"#).expect("a table");
    let at = |rig: &Rig, counts: f64| rig.axes[0].value_at(counts);
    for (counts, further) in
        [(120_000.0, 0.0), (220_000.0, 0.05), (320_000.0, 0.1), (380_000.0, 0.04), (500_000.0, -0.02)]
    {
        let error = at(&rig, counts) - at(&plain, counts);
        assert!((error - further).abs() < 1e-6, "{counts}: {error} mm");
    }
    let mode = rig.mode("herbivore").expect("a mode").targets.clone();
    // 145 mm is true where the encoder says 144.915: 85 um are missing from the 100 um at 160 mm.
    assert_eq!(rig.wire_targets(&mode)[0].0, 144_915);
    assert_eq!(rig.wire_distances(&mode)[0].0, 145_000, "a distance has no place");
    let (before, after) = (plain.pose_read_at(&[145.0, 0.5]), rig.pose_read_at(&[145.0, 0.5]));
    assert!((baseline(&before) - baseline(&after)).abs() < 1e-9, "the same true place");
    let provenance = Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let written = Rig::from_toml(&rig.to_toml(&provenance).expect("it can be written")).expect("and read");
    assert_eq!(written.axes[0].pitch, rig.axes[0].pitch);
}

#[test]
fn what_is_no_table_is_refused_with_its_place() {
    for (table, words) in [
        ("[]", "two entries"),
        (r#"[["60mm", "0um"]]"#, "two entries"),
        (r#"[["60mm", "0um"], ["60mm", "1um"]]"#, "entry 2: its position"),
        (r#"[["60mm", "0um"], ["70mm", "1um"], ["65mm", "1um"]]"#, "entry 3: its position"),
        (r#"[["60mm", "0um"], ["61mm", "101um"]]"#, "entry 2: the error"),
        (r#"[["60mm", "0deg"], ["61mm", "1um"]]"#, "pitch_error of axis 'baseline'"),
    ] {
        let refused = bench(table).expect_err(table);
        assert!(refused.contains(words) && refused.contains("baseline"), "{table}: {refused}");
    }
    assert_eq!(PitchTable::new(vec![[0.0, 0.0], [f64::NAN, 0.0]]), Err(PitchTableError::NotRising(2)));
}

proptest! {
    /// The way from the encoder to the truth and back ends where it began, on the table and beyond it.
    #[test]
    fn there_and_back(
        steps in prop::collection::vec((0.1f64..50.0, -0.1f64..0.1), 1..20),
        at in -1_000.0f64..1_000.0,
    ) {
        let mut entries = vec![[-300.0, 1.0]];
        for (way, slope) in steps {
            let [position, error] = *entries.last().expect("an entry");
            entries.push([position + way, error + slope * way]);
        }
        let table = PitchTable::new(entries).expect("it rises, and is not steep");
        prop_assert!((table.encoder(table.truth(at)) - at).abs() < 1e-9);
        prop_assert!(table.truth(at + 0.01) > table.truth(at));
    }
}
